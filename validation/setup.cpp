#include "validation/setup.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"

namespace graupel::validation {

Scene space_scene(double dx, const Vec3d& low, const Vec3d& high) {
  Scene scene;
  scene.domain.dx = dx;
  scene.domain.walls = Contact::slip;
  scene.domain.wall_cells = 2;
  const Vec3d margin = Vec3d::filled(static_cast<double>(scene.domain.wall_cells) * dx);
  scene.domain.origin = low - margin;
  scene.domain.size = high - low + 2.0 * margin;
  scene.gravity = {0, 0, 0};
  return scene;
}

Scene plane_scene(double dx, const Vec2d& low, const Vec2d& high) {
  Scene scene = space_scene(dx, {low[0], low[1], 0}, {high[0], high[1], dx});
  scene.domain.dimensions = 2;
  scene.domain.origin[2] = -plane_depth / 2;
  scene.domain.size[2] = plane_depth;
  return scene;
}

std::vector<Vec3d> space_lattice(const Scene& scene, const Vec3d& low, const Vec3d& high, int per_axis,
                                 const std::function<bool(const Vec3d&)>& inside) {
  const double spacing = scene.domain.dx / per_axis;
  Vec<int64_t, 3> first, last;
  for (int d = 0; d < 3; ++d) {
    first[d] = std::llround((low[d] - scene.domain.origin[d]) / spacing);
    last[d] = std::llround((high[d] - scene.domain.origin[d]) / spacing);
  }
  std::vector<Vec3d> points;
  for (int64_t i = first[0]; i < last[0]; ++i)
    for (int64_t j = first[1]; j < last[1]; ++j)
      for (int64_t k = first[2]; k < last[2]; ++k) {
        const Vec3d x = scene.domain.origin + spacing * (Vec<int64_t, 3>{i, j, k}.cast<double>() + Vec3d::filled(0.5));
        if (!inside || inside(x)) points.push_back(x);
      }
  return points;
}

std::vector<Vec2d> plane_lattice(const Scene& scene, const Vec2d& low, const Vec2d& high, int per_axis,
                                 const std::function<bool(const Vec2d&)>& inside) {
  const double spacing = scene.domain.dx / per_axis;
  std::vector<Vec2d> points;
  for (const Vec3d& x : space_lattice(scene, {low[0], low[1], 0}, {high[0], high[1], spacing}, per_axis))
    if (!inside || inside({x[0], x[1]})) points.push_back({x[0], x[1]});
  return points;
}

std::vector<Vec2d> turned_lattice(const Scene& scene, const Vec2d& corner, const Vec2d& along, const Vec2d& size,
                                  int per_axis) {
  const double spacing = scene.domain.dx / per_axis;
  const Vec2d left = {-along[1], along[0]};
  std::vector<Vec2d> points;
  for (double a = spacing / 2; a < size[0]; a += spacing)
    for (double b = spacing / 2; b < size[1]; b += spacing) points.push_back(corner + a * along + b * left);
  return points;
}

Source& add_points(Scene& scene, const std::string& material, const std::vector<Vec3d>& points, int per_axis) {
  Source source;
  source.shape = Shape::points;
  source.points = std::make_shared<const std::vector<Vec3d>>(points);
  source.material = material;
  source.particles_per_cell = per_axis * per_axis * per_axis;
  scene.sources.push_back(source);
  return scene.sources.back();
}

Source& add_plane_points(Scene& scene, const std::string& material, const std::vector<Vec2d>& points, int per_axis) {
  std::vector<Vec3d> in_space;
  in_space.reserve(points.size());
  for (const Vec2d& x : points) in_space.push_back({x[0], x[1], scene.domain.plane()});
  Source& source = add_points(scene, material, in_space, per_axis);
  source.particles_per_cell = per_axis * per_axis;
  return source;
}

void add_grip(Scene& scene, const Vec3d& low, const Vec3d& high, const Vec3d& velocity, Contact contact) {
  Obstacle box;
  box.size = high - low;
  box.position = 0.5 * (low + high);
  box.contact = contact;
  box.motion = Motion{};
  box.motion->velocity = velocity;
  scene.obstacles.push_back(box);
  scene.push_out = false;
}

MaterialConfig preset(const std::string& name) {
  const auto found = material_preset(name);
  if (!found) throw ConfigError(fmt::format("unknown preset '{}'", name));
  MaterialConfig m = *found;
  m.name = name;
  return m;
}

MaterialConfig elastic(double youngs_modulus, double poissons_ratio, double density) {
  MaterialConfig m;
  m.model = MaterialModel::jelly;
  m.youngs_modulus = youngs_modulus;
  m.poissons_ratio = poissons_ratio;
  m.density = density;
  return m;
}

void set_time(Scene& scene, double duration, int64_t frames, double courant) {
  scene.frames = frames;
  scene.frame_time = duration / static_cast<double>(frames);
  scene.time_step.policy = StepPolicy::adaptive;
  scene.time_step.courant = courant;
  scene.time_step.max_step = scene.frame_time;
}

std::unique_ptr<Solver> start(const Scene& scene, const std::function<Vec3d(const Vec3d&)>& velocity) {
  mpm::SampledParticles sampled = mpm::sample_sources(scene, scene.seed);
  if (velocity)
    for (std::size_t i = 0; i < sampled.position.size(); ++i) sampled.velocity[i] = velocity(sampled.position[i]);
  return std::make_unique<Solver>(scene, mpm::SimulationOptions{.precision = mpm::Precision::f64}, sampled,
                                  sparsegrid::ObstacleSet(scene));
}

Particles particles_of(const Solver& solver) {
  const Particles slots = solver.particles();
  Particles ordered(slots.size());
  for (std::size_t s = 0; s < slots.size(); ++s) {
    const auto i = static_cast<std::size_t>(slots.source_index[s]);
    ordered.position[i] = slots.position[s];
    ordered.velocity[i] = slots.velocity[s];
    ordered.affine_velocity[i] = slots.affine_velocity[s];
    ordered.deformation_gradient[i] = slots.deformation_gradient[s];
    ordered.stress[i] = slots.stress[s];
    ordered.internal[i] = slots.internal[s];
    ordered.volume[i] = slots.volume[s];
    ordered.material[i] = slots.material[s];
    ordered.source_index[i] = slots.source_index[s];
  }
  return ordered;
}

void run_frames(Solver& solver, const Scene& scene, const RunOptions& options, const std::function<void()>& watch) {
  watch();
  for (int64_t f = 0; f < scene.frames; ++f) {
    solver.advance_frame();
    options.between_frames();
    watch();
  }
}

std::vector<double> zero_crossings(const std::vector<double>& x, const std::vector<double>& y) {
  std::vector<double> found;
  for (std::size_t i = 1; i < x.size(); ++i)
    if ((y[i - 1] > 0) != (y[i] > 0)) found.push_back(x[i - 1] + (x[i] - x[i - 1]) * y[i - 1] / (y[i - 1] - y[i]));
  return found;
}

Line fit_line(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sx += x[i];
    sy += y[i];
    sxx += x[i] * x[i];
    sxy += x[i] * y[i];
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return {slope, (sy - slope * sx) / n};
}

double interpolated(const std::vector<double>& xs, const std::vector<double>& ys, double x) {
  std::size_t i = 1;
  while (i + 1 < xs.size() && xs[i] < x) ++i;
  return ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
}

}  // namespace graupel::validation
