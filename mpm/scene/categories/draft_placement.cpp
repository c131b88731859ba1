// Bodies, obstacles and streams of a draft: their sizes, and places where they touch nothing.
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "mpm/scene/categories/scene_draft.h"

namespace graupel::mpm {

namespace {

constexpr double shortest_stream = 0.02;  ///< [s]
constexpr double narrowest = 0.35;        ///< smallest extent over the largest one, before a body is shrunk

void rotate_body(Body& body, Pose pose, Draws& draws) {
  if (pose == Pose::free) return draws.rotation(body.rotation_axis, body.rotation_angle);
  body.rotation_axis = {0, 1, 0};
  body.rotation_angle = draws.uniform(0, 360);
}

/// The upper half of the sizes, in their logarithm.
Interval large(const Interval& sizes) { return {std::sqrt(sizes.low * sizes.high), sizes.high}; }

}  // namespace

std::optional<Source> SceneDraft::body(Pose pose) { return body(pose, recipe.bodies.shapes, recipe.bodies.size); }

std::optional<Source> SceneDraft::body(Pose pose, const std::vector<Shape>& shapes, const Interval& sizes) {
  const double most = take_share() * particle_volume(), least = recipe.bodies.size.low;
  double size = draws.in(sizes);
  Source source;
  source.sampling = Sampling::random;
  source.particles_per_cell = recipe.bodies.particles_per_cell;
  source.shape = draws.one_of(shapes);
  set_size(source, size);
  const auto narrower = [&] { return std::max(least, size * draws.uniform(narrowest, 1)); };
  if (source.shape == Shape::box) {
    const int longest = static_cast<int>(draws.integer(3));
    for (int d = 0; d < 3; ++d)
      if (d != longest) source.size[d] = narrower();
  } else if (source.shape == Shape::cylinder) {
    const double extent = narrower();  // a column or a disc
    if (draws.chance(0.5))
      source.radius = extent / 2;
    else
      source.height = extent;
  }
  bool small_enough = false;
  if (source.shape == Shape::mesh) {
    const RecipeGeometry& geometry = draws.one_of(recipe.bodies.geometry);
    use_geometry(source, Shape::mesh, geometry, 1);
    size = std::min(size, std::cbrt(most / volume(source)));
    small_enough = size >= least;
    use_geometry(source, Shape::mesh, geometry, std::max(size, least));
  } else {
    small_enough = shrink(source, most, least);
  }
  rotate_body(source, pose, draws);
  if (!small_enough) return std::nullopt;
  return source;
}

std::optional<Source> SceneDraft::dam() {
  const double first = take_share();
  if (!shares_.empty()) shares_.back() += first;
  std::optional<Source> dam = body(Pose::upright, {Shape::box}, large(recipe.bodies.size));
  if (dam) dam->rotation_angle = 0;
  return dam;
}

std::optional<Source> SceneDraft::column() {
  const double most = take_share() * particle_volume(), least = recipe.bodies.size.low;
  Source column;
  column.sampling = Sampling::random;
  column.particles_per_cell = recipe.bodies.particles_per_cell;
  column.shape = draws.chance(0.5) ? Shape::cylinder : Shape::box;
  const double height = draws.in(large(recipe.bodies.size)), width = std::max(least, height / draws.uniform(1, 5));
  column.height = height;
  column.radius = width / 2;
  column.size = {width, height, std::max(least, width * draws.uniform(0.7, 1))};
  rotate_body(column, Pose::upright, draws);
  if (!shrink(column, most, least)) return std::nullopt;
  return column;
}

void SceneDraft::throw_body(Source& body, const Vec3d& direction, const Interval& speed) {
  body.velocity = direction * draws.in(speed);
  body.angular_velocity = draws.direction() * draws.in(recipe.bodies.spin);
}

sparsegrid::LocalBox SceneDraft::file_box(const Body& body) const {
  if (sparsegrid::is_analytic(body.shape)) return {};
  for (const auto* list :
       {&recipe.bodies.geometry, &recipe.obstacles.mesh_geometry, &recipe.obstacles.level_set_geometry})
    for (const RecipeGeometry& geometry : *list)
      if (geometry.file == body.file) {
        const sparsegrid::LocalBox box = bounds_of(geometry);
        return {box.low * body.scale, box.high * body.scale};
      }
  throw std::logic_error("file_box: not a file of the recipe");
}

bool SceneDraft::is_clear(const Body& body, double gap) const {
  const auto touches = [&](const Body& other) { return may_touch(body, other, gap); };
  return std::none_of(obstacle_envelopes_.begin(), obstacle_envelopes_.end(), touches) &&
         std::none_of(body_envelopes_.begin(), body_envelopes_.end(), touches);
}

bool SceneDraft::add(Source source, const Part& part, Place where) {
  const sparsegrid::LocalBox box = file_box(source);
  const auto draw = [&]() -> Body {
    const Vec3d wanted = point_in(part);
    source.position = Vec3d::zero();
    const Body at_origin = envelope(source, box);
    const sparsegrid::LocalBox extent = world_extent(at_origin);
    for (int d = 0; d < 3; ++d) {
      // Particles on the very wall are within it, but for the rounding of the turn.
      const double from = low()[d] - extent.low[d] - at_origin.position[d] + 1e-9,
                   to = high()[d] - extent.high[d] - at_origin.position[d] - 1e-9;
      const double clamped =
          where == Place::on_floor && d == 1 ? from : std::clamp(wanted[d], from, std::max(from, to));
      source.position[d] = from <= to ? clamped : 1e300;
    }
    return envelope(source, box);
  };
  const auto fits = [&](const Body& body) {
    return std::max({body.position[0], body.position[1], body.position[2]}) < 1e300 &&
           is_clear(body, scene.domain.dx / 2);
  };
  if (!place(draw, fits)) return false;
  body_envelopes_.push_back(envelope(source, box));
  scene.sources.push_back(std::move(source));
  return true;
}

bool SceneDraft::add_bodies(int64_t n, Pose pose, const Part& part, Place where,
                            const std::vector<MaterialModel>& models) {
  for (int64_t i = 0; i < n; ++i) {
    std::optional<Source> drawn = body(pose);
    if (drawn) {
      drawn->material = material(models);
      if (add(*drawn, part, where)) continue;
    }
    if (i == 0) return false;
  }
  return true;
}

Obstacle SceneDraft::obstacle() {
  const RecipeFixedObstacles& r = recipe.obstacles;
  const double size = draws.in(r.size);
  Obstacle drawn;
  drawn.shape = draws.one_of(r.shapes);
  set_contact(drawn);
  set_size(drawn, size);
  if (drawn.shape == Shape::mesh) use_geometry(drawn, Shape::mesh, draws.one_of(r.mesh_geometry), size);
  if (drawn.shape == Shape::vdb) use_geometry(drawn, Shape::vdb, draws.one_of(r.level_set_geometry), size);
  // Thinner than two cells, a body is not seen by the grid.
  const auto narrower = [&] { return std::max(2.5 * scene.domain.dx, size * draws.uniform(narrowest, 1)); };
  const int longest = static_cast<int>(draws.integer(3));
  for (int d = 0; d < 3; ++d)
    if (d != longest) drawn.size[d] = narrower();
  if (drawn.shape == Shape::half_box) drawn.size[1] = 2 * narrower();
  if (drawn.shape == Shape::cylinder || drawn.shape == Shape::cone) drawn.radius = narrower() / 2;
  return drawn;
}

void SceneDraft::add(const Obstacle& obstacle) {
  obstacle_envelopes_.push_back(envelope(obstacle, file_box(obstacle)));
  scene.obstacles.push_back(obstacle);
}

void SceneDraft::add_obstacles(int64_t n) {
  for (int64_t i = 0; i < n; ++i) {
    Obstacle drawn = obstacle();
    const bool stands = draws.chance(0.5);
    rotate_body(drawn, stands ? Pose::upright : Pose::free, draws);
    const sparsegrid::LocalBox box = file_box(drawn);
    const auto draw = [&] {
      drawn.position = point_in({});
      if (stands) {
        const Body placed = envelope(drawn, box);
        drawn.position[1] += low()[1] - (placed.position[1] + world_extent(placed).low[1]);
      }
      return envelope(drawn, box);
    };
    const auto fits = [&](const Body& body) {
      const auto overlaps = [&](const Body& other) { return overlap(body, other); };
      return std::none_of(obstacle_envelopes_.begin(), obstacle_envelopes_.end(), overlaps) &&
             std::none_of(kept_out_.begin(), kept_out_.end(), overlaps) &&
             std::none_of(body_envelopes_.begin(), body_envelopes_.end(),
                          [&](const Body& other) { return may_touch(body, other, scene.domain.dx / 2); });
    };
    if (place(draw, fits)) add(drawn);
  }
}

bool SceneDraft::add_stream(const Vec3d& position, const Vec3d& direction, double width, const std::string& material,
                            double most_particles) {
  Emitter emitter;
  emitter.material = material;
  emitter.particles_per_cell = recipe.bodies.particles_per_cell;
  emitter.shape = draws.chance(0.5) ? Shape::cylinder : Shape::box;
  emitter.radius = width / 2;
  emitter.height = scene.domain.dx;
  emitter.size = {width, scene.domain.dx, width};
  emitter.position = position;
  // Its y axis along the stream.
  const Vec3d axis = cross(Vec3d{0, 1, 0}, direction);
  emitter.rotation_axis = norm(axis) > 1e-6 ? normalized(axis) : Vec3d{1, 0, 0};
  emitter.rotation_angle = std::acos(std::clamp(direction[1], -1.0, 1.0)) * 180 / 3.14159265358979323846;
  const double speed = draws.in(recipe.streams.speed);
  emitter.velocity = direction * speed;
  emitter.start_time = draws.uniform(0, 0.2);
  const double spacing = scene.domain.spacing(emitter.particles_per_cell), across = std::ceil(width / spacing);
  const double duration =
      std::min(draws.in(recipe.streams.duration), most_particles * spacing / (across * across * speed));
  emitter.end_time = emitter.start_time + duration;
  emitter.particle_limit = std::max<int64_t>(1, recipe.max_particles);
  const sparsegrid::LocalBox extent = world_extent(emitter);
  for (int d = 0; d < 3; ++d)
    if (position[d] + extent.low[d] < low()[d] || position[d] + extent.high[d] > high()[d]) return false;
  if (!(duration > shortest_stream) || !is_clear(emitter, 2 * scene.domain.dx)) return false;
  body_envelopes_.push_back(emitter);
  scene.emitters.push_back(std::move(emitter));
  return true;
}

}  // namespace graupel::mpm
