#include "mpm/scene/categories/category_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <type_traits>

#include "core/system/error.h"
#include "mpm/materials/material_parameters.h"
#include "mpm/scene/categories/moving_bodies.h"
#include "mpm/scene/categories/scene_draft.h"
#include "mpm/solver/time_step.h"

namespace graupel::mpm {

namespace {

using Models = std::vector<MaterialModel>;

constexpr Part everywhere = {};
constexpr Part upper = {{0, 0.35, 0}, {1, 1, 1}};
constexpr Part lower = {{0, 0, 0}, {1, 0.4, 1}};

int64_t few_obstacles(SceneDraft& draft) { return draft.draws.integer(3); }

/// A block at one wall or in a corner, on the floor; obstacles and a few other bodies beyond.
bool dam_break(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const int64_t others = std::min<int64_t>(draws.integer(3), draft.recipe.bodies.count.high - 1);
  draft.share_particles(others + 2);  // the dam takes two shares
  std::optional<Source> dam = draft.dam();
  if (!dam) return false;
  dam->material = draft.material(models_of(SceneCategory::dam_break));
  Part corner = {{0, 0, 0}, {0, 0, 1}};
  if (draws.chance(0.5)) corner.low[0] = corner.high[0] = 1;
  if (draws.chance(0.5)) corner.low[2] = corner.high[2] = draws.chance(0.5) ? 1 : 0;
  if (!draft.add(*dam, corner, Place::on_floor)) return false;
  draft.add_obstacles(few_obstacles(draft));
  draft.add_bodies(others, Pose::upright, lower, Place::anywhere);
  return true;
}

/// One to three columns on the floor.
bool column_collapse(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const int64_t columns = std::min<int64_t>(1 + draws.integer(3), draft.recipe.bodies.count.high);
  draft.share_particles(columns);
  for (int64_t i = 0; i < columns; ++i) {
    std::optional<Source> column = draft.column();
    if (column) {
      column->material = draft.material(i == 0 ? models_of(SceneCategory::column_collapse) : Models{});
      if (draft.add(*column, everywhere, Place::on_floor)) continue;
    }
    if (i == 0) return false;
  }
  draft.add_obstacles(few_obstacles(draft));
  return true;
}

/// Bodies at rest above obstacles.
bool fall_on_obstacles(SceneDraft& draft) {
  const int64_t bodies = draft.draws.whole(draft.recipe.bodies.count);
  draft.add_obstacles(draft.draws.whole(draft.recipe.obstacles.count));
  draft.share_particles(bodies);
  return draft.add_bodies(bodies, Pose::free, upper, Place::anywhere);
}

/// Bodies with velocity and spin in any direction.
bool thrown_bodies(SceneDraft& draft) {
  const int64_t bodies = draft.draws.whole(draft.recipe.bodies.count);
  draft.add_obstacles(few_obstacles(draft));
  draft.share_particles(bodies);
  if (!draft.add_bodies(bodies, Pose::free, everywhere, Place::anywhere)) return false;
  for (Source& source : draft.scene.sources)
    draft.throw_body(source, draft.draws.direction(), draft.recipe.bodies.speed);
  return true;
}

/// Snow aimed at an obstacle or a point of the walls, in the upper half of the speeds; other bodies lie in the way.
bool snow_impact(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const int64_t most = draft.recipe.bodies.count.high, balls = std::min<int64_t>(1 + draws.integer(3), most),
                others = std::min<int64_t>(draws.integer(3), most - balls);
  draft.add_obstacles(1 + few_obstacles(draft));
  draft.share_particles(balls + others);
  if (!draft.add_bodies(balls, Pose::free, everywhere, Place::anywhere, models_of(SceneCategory::snow_impact)))
    return false;
  const Interval& speed = draft.recipe.bodies.speed;
  for (Source& ball : draft.scene.sources) {
    Vec3d target = draft.point_in(everywhere);
    if (!draft.scene.obstacles.empty() && draws.chance(0.5)) {
      target = draws.one_of(draft.scene.obstacles).position;
    } else {
      const int axis = static_cast<int>(draws.integer(3));
      target[axis] = axis != 1 && draws.chance(0.5) ? draft.high()[axis] : draft.low()[axis];
    }
    const Vec3d way = target - ball.position;
    const Vec3d direction = norm(way) > 1e-6 ? normalized(way) : Vec3d{0, -1, 0};
    draft.throw_body(ball, direction, {(speed.low + speed.high) / 2, speed.high});
  }
  draft.add_bodies(others, Pose::upright, lower, Place::on_floor);
  return true;
}

/// Streams from above or from the side onto obstacles.
bool stream(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const int64_t streams = draws.whole(draft.recipe.streams.count);
  const int64_t bodies = std::min<int64_t>(draws.integer(3), draft.recipe.bodies.count.high);
  draft.add_obstacles(draws.whole(draft.recipe.obstacles.count));
  draft.share_particles(streams + bodies);
  for (int64_t i = 0; i < streams; ++i) {
    const double width = draws.in(draft.recipe.streams.width);
    const std::string material = draft.material();
    const double most_particles = draft.take_share();
    const bool placed = place(
        [&] {
          const Vec3d from = draft.point_in({{0, 0.6, 0}, {1, 1, 1}});
          // Towards the middle, at any angle from level to straight down.
          const Vec3d middle = (draft.low() + draft.high()) * 0.5;
          const Vec3d level = normalized(Vec3d{middle[0] - from[0] + 1e-6, 0, middle[2] - from[2]});
          const double down = draws.uniform(0, 1.5707963267948966);
          return draft.add_stream(from, level * std::cos(down) - Vec3d{0, std::sin(down), 0}, width, material,
                                  most_particles);
        },
        [](bool added) { return added; });
    if (!placed && i == 0) return false;
  }
  draft.add_bodies(bodies, Pose::upright, lower, Place::on_floor);
  return true;
}

/// The part of the domain from the middle of a box in the world upwards, and within it sideways.
Part above(const SceneDraft& draft, const sparsegrid::LocalBox& box) {
  const Vec3d inside = draft.high() - draft.low();
  Part part;
  for (const int d : {0, 2}) {
    part.low[d] = std::clamp((box.low[d] - draft.low()[d]) / inside[d], 0.0, 1.0);
    part.high[d] = std::clamp((box.high[d] - draft.low()[d]) / inside[d], 0.0, 1.0);
  }
  part.low[1] = std::clamp(((box.low[1] + box.high[1]) / 2 - draft.low()[1]) / inside[1], 0.0, 1.0);
  return part;
}

/// A paddle, a sliding box or a tray; two thirds of the bodies fall on it, the others lie or fall anywhere.
bool moving_obstacle(SceneDraft& draft) {
  constexpr std::array<Body (*)(SceneDraft&), 3> movers = {add_paddle, add_sliding_box, add_tray};
  const Body mover = draft.draws.one_of(movers)(draft);
  draft.add_obstacles(few_obstacles(draft));
  const int64_t bodies = draft.draws.whole(draft.recipe.bodies.count), on_it = (2 * bodies + 2) / 3;
  draft.share_particles(bodies);
  sparsegrid::LocalBox box = world_extent(mover);
  box.low += mover.position;
  box.high += mover.position;
  if (!draft.add_bodies(on_it, Pose::free, above(draft, box), Place::anywhere)) return false;
  draft.add_bodies(bodies - on_it, Pose::free, everywhere, Place::anywhere);
  return true;
}

/// A container under a stream or under falling bodies, of no more material than overflows it a little.
bool filling_container(SceneDraft& draft) {
  Draws& draws = draft.draws;
  const Opening opening = add_container(draft);
  const double volume = opening.volume * draws.uniform(0.5, 1.2), room = draft.high()[1] - opening.center[1];
  if (draws.chance(0.5)) {
    draft.share_particles(1, volume);
    const double width = std::min({draws.in(draft.recipe.streams.width), 0.6 * opening.width, 0.6 * opening.depth});
    const Vec3d from = opening.center + Vec3d{0, draws.uniform(0.4, 0.9) * room, 0};
    return draft.add_stream(from, {0, -1, 0}, width, draft.material(), draft.take_share());
  }
  const int64_t bodies = draws.whole(draft.recipe.bodies.count);
  draft.share_particles(bodies, volume);
  const Vec3d half = {opening.width / 3, 0, opening.depth / 3};
  return draft.add_bodies(bodies, Pose::free, above(draft, {opening.center - half, opening.center + half}),
                          Place::anywhere);
}

bool compose(SceneCategory category, SceneDraft& draft) {
  switch (category) {
    case SceneCategory::dam_break:
      return dam_break(draft);
    case SceneCategory::column_collapse:
      return column_collapse(draft);
    case SceneCategory::fall_on_obstacles:
      return fall_on_obstacles(draft);
    case SceneCategory::thrown_bodies:
      return thrown_bodies(draft);
    case SceneCategory::snow_impact:
      return snow_impact(draft);
    case SceneCategory::stream:
      return stream(draft);
    case SceneCategory::moving_obstacle:
      return moving_obstacle(draft);
    case SceneCategory::filling_container:
      return filling_container(draft);
  }
  return false;
}

/// The material with the constants of its ranges that give the fastest waves and diffusion.
MaterialConfig stiffest(const RecipeMaterial& from) {
  MaterialConfig material = from;
  MaterialConfig::fields([&](auto member, const FieldInfo& info) {
    if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>)
      if (const auto range = from.ranges.find(std::string(info.name)); range != from.ranges.end())
        material.*member = info.name == "density" ? range->second.low : range->second.high;
  });
  return material;
}

bool has_category(const CategoryRecipe& recipe, const std::vector<SceneCategory>& any) {
  return std::find_first_of(recipe.categories.begin(), recipe.categories.end(), any.begin(), any.end()) !=
         recipe.categories.end();
}

void check_step(const CategoryRecipe& recipe) {
  if (recipe.time_step.policy == StepPolicy::adaptive) return;
  const double courant = largest_courant(recipe);
  if (courant <= 1) return;
  throw ConfigError(fmt::format(
      "recipe key 'time_step.substeps_per_frame' is too small for the stiffest constants that 'materials' can give and "
      "the fastest bodies, streams and obstacles ({}, at least {:.0f}: in a substep a wave crosses {:.3g} cells, "
      "allowed up to 1). Raise it, "
      "or lower the upper ends of youngs_modulus, bulk_modulus, viscosity, bodies.speed, streams.speed, motions.speed "
      "or motions.spin",
      recipe.time_step.substeps_per_frame,
      std::ceil(courant * static_cast<double>(recipe.time_step.substeps_per_frame)), courant));
}

}  // namespace

double largest_courant(const CategoryRecipe& recipe) {
  StateSpeeds speeds;
  for (const auto& [name, from] : recipe.materials) {
    const auto material = material_parameters<double>(stiffest(from));
    speeds.sound_speed = std::max(speeds.sound_speed, material.elastic_speed);
    speeds.diffusivity = std::max(speeds.diffusivity, material.viscosity / material.density);
  }
  double height = 0;
  for (const Vec3d& size : recipe.domain.sizes) height = std::max(height, size[1]);
  double start = recipe.bodies.speed.high;
  if (has_category(recipe, {SceneCategory::stream, SceneCategory::filling_container}))
    start = std::max(start, recipe.streams.speed.high);
  // Material that starts at the top with this speed: v^2 = v0^2 + 2 g h.
  speeds.speed = std::sqrt(start * start + 2 * norm(recipe.gravity) * height);
  if (has_category(recipe, {SceneCategory::moving_obstacle}))  // a sliding box, the tip of a paddle
    speeds.speed =
        std::max({speeds.speed, recipe.motions.speed.high, recipe.motions.spin.high * recipe.obstacles.size.high / 2});
  const double dt = recipe.frame_time / static_cast<double>(recipe.time_step.substeps_per_frame);
  // Where particles are faster, a frame has more substeps, in which waves go less far.
  if (recipe.time_step.policy == StepPolicy::per_frame)
    speeds.speed = std::min(speeds.speed, recipe.time_step.courant * recipe.domain.dx / dt);
  TimeStep unit;
  unit.policy = StepPolicy::adaptive;
  unit.courant = 1;
  unit.max_step = 1e300;
  const double stable = largest_step(unit, recipe.domain.dx, 1e300, speeds);
  return dt / stable;
}

Scene draw_scene(const CategoryRecipe& recipe, uint64_t seed, Split split, int64_t index, int64_t attempt) {
  check_step(recipe);
  const SceneCategory category = recipe.category(index);
  Draws draws(seed, stream_of(split, index, attempt));
  // What was drawn first can leave no room for the rest: then the whole layout is drawn anew.
  for (int layout = 0; layout < 100; ++layout) {
    SceneDraft draft(recipe, draws);
    draft.draw_materials(models_of(category));
    if (!compose(category, draft)) continue;
    draft.scene.name = fmt::format("{}-{}-{:05d}-{}", recipe.name, name_of(split), index, word_of(category));
    draft.scene.seed = sampling_seed(seed, split, index, attempt);
    return draft.scene;
  }
  throw ConfigError(fmt::format(
      "no room for the bodies of scene {} of '{}' ({}; bodies of {:.4g} to {:.4g} m, obstacles of {:.4g} to {:.4g} m, "
      "streams of {:.4g} to {:.4g} m and {:.4g} to {:.4g} m/s, max_particles {}, particles_per_cell {:.4g}). "
      "Use fewer or smaller ones, larger domains, or raise max_particles",
      index, recipe.name, word_of(category), recipe.bodies.size.low, recipe.bodies.size.high, recipe.obstacles.size.low,
      recipe.obstacles.size.high, recipe.streams.width.low, recipe.streams.width.high, recipe.streams.speed.low,
      recipe.streams.speed.high, recipe.max_particles, recipe.bodies.particles_per_cell));
}

}  // namespace graupel::mpm
