#include "mpm/scene_variants.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/math/random.h"
#include "core/parallel/memory.h"
#include "core/system/error.h"
#include "mpm/memory_need.h"
#include "mpm/scene/emission.h"

namespace graupel::mpm {

namespace {

/// Each point becomes the corners of a cube (a square in the plane) of edge `edge` around it.
std::shared_ptr<const std::vector<Vec3d>> corners_around(const std::vector<Vec3d>& points, double edge, bool plane) {
  std::vector<Vec3d> corners;
  for (const Vec3d& x : points)
    for (int corner = 0; corner < (plane ? 4 : 8); ++corner) {
      Vec3d offset = {0, 0, 0};
      for (int d = 0; d < (plane ? 2 : 3); ++d) offset[d] = ((corner >> d) & 1) ? edge / 2 : -edge / 2;
      corners.push_back(x + offset);
    }
  return std::make_shared<const std::vector<Vec3d>>(std::move(corners));
}

/// Gives the emitters of `changed` the flux that they have in `scene`, with `share` of the particles a cell.
void keep_flux(const Scene& scene, Scene& changed, double share = 1) {
  for (std::size_t e = 0; e < scene.emitters.size(); ++e)
    changed.emitters[e] = with_flux_of(scene.emitters[e], e, scene.domain, changed.domain, share);
}

struct Word {
  const char* word;
  SolverVariant variant;
};
constexpr Word words[] = {{"mpm", same_solver},
                          {"mpm:fast", fast_solver},
                          {"mpm:coarse", coarse_solver},
                          {"mpm:coarse:fast", coarse_fast_solver},
                          {"mpm:fine", fine_solver}};

}  // namespace

std::optional<SolverVariant> parse_variant(const std::string& word) {
  for (const Word& known : words)
    if (word == known.word) return known.variant;
  return std::nullopt;
}

std::string variant_word(const SolverVariant& variant) {
  for (const Word& known : words)
    if (variant == known.variant) return known.word;
  return fmt::format("mpm at {} dx{}", variant.resolution,
                     variant.step == StepRule::given ? "" : " with the largest stable step");
}

std::vector<std::string> variant_list() {
  std::vector<std::string> list;
  for (const Word& known : words) list.emplace_back(known.word);
  return list;
}

std::string variant_words() {
  std::string all;
  for (const std::string& word : variant_list()) all += (all.empty() ? "" : ", ") + word;
  return all;
}

double ratio_of_whole_cells(const Domain& domain, double ratio) {
  int64_t cells = 0;  // greatest common divisor over the periodic axes
  for (int d = 0; d < domain.axes(); ++d)
    if (domain.wall(d, 0) == Wall::periodic)
      cells = std::gcd(cells, std::llround((domain.wall_high()[d] - domain.wall_low()[d]) / domain.dx));
  if (cells == 0) return ratio;
  const auto n = static_cast<double>(cells);
  return n / std::max(1.0, std::round(n / ratio));
}

Scene fine_variant(const Scene& scene) {
  Scene fine = scene;
  fine.domain.dx = scene.domain.dx / 2;
  fine.domain.wall_cells = 2 * scene.domain.wall_cells;  // the walls and the domain's faces stay where they are
  fine.obstacle_voxel = scene.voxel();
  fine.obstacle_band = scene.band();
  fine.time_step.substeps_per_frame = 2 * scene.time_step.substeps_per_frame;
  for (Source& source : fine.sources) {
    if (source.shape != Shape::points || !source.points) continue;
    const bool plane = scene.domain.is_plane();
    const double distance = scene.domain.dx / std::pow(source.particles_per_cell, plane ? 1.0 / 2 : 1.0 / 3);
    source.points = corners_around(*source.points, distance / 2, plane);
  }
  keep_flux(scene, fine);
  return fine;
}

Scene variant_scene(const Scene& scene, const SolverVariant& variant) {
  if (variant.resolution > 1) return coarse_variant(scene);
  return variant.resolution < 1 ? fine_variant(scene) : scene;
}

void check_variant_fits(const Scene& scene, const SolverVariant& variant, const SimulationOptions& options,
                        double stored, uint64_t available_on_host, uint64_t available_on_device) {
  const MemoryNeed need = least_memory(variant_scene(scene, variant), options);
  const auto check = [&](double bytes, uint64_t available, const char* where) {
    if (bytes <= static_cast<double>(available)) return;
    throw ConfigError(fmt::format(
        "'{}' of scene '{}' does not fit into the memory of the {} (at least {:.4g} GB needed for {:.0f} particles, "
        "{:.4g} GB available). Leave it out, make the scene smaller (--set domain.dx=...), compare fewer --frames, or "
        "use a machine with more memory",
        variant_word(variant), scene.name, where, 1e-9 * bytes, need.particles, 1e-9 * static_cast<double>(available)));
  };
  check(need.host_bytes + stored * sizeof(Vec3f), available_on_host, "machine");
  check(need.device_bytes, available_on_device, "GPU");
}

void check_variant_fits(const Scene& scene, const SolverVariant& variant, const SimulationOptions& options,
                        double stored) {
  check_variant_fits(
      scene, variant, options, stored, available_bytes(Device::cpu),
      options.device == Device::cpu ? std::numeric_limits<uint64_t>::max() : available_bytes(options.device));
}

Scene scene_of_points(const Scene& scene, std::vector<std::vector<Vec3d>> points) {
  Scene changed = scene;
  for (std::size_t s = 0; s < changed.sources.size(); ++s) {
    Source& source = changed.sources[s];
    source.spin_center = source.spin_center.value_or(source.position);
    if (source.motion) source.motion->center = source.motion->center.value_or(source.position);
    source.shape = Shape::points;
    source.mesh.reset();
    source.points = std::make_shared<const std::vector<Vec3d>>(std::move(points[s]));
    source.position = {0, 0, 0};
    source.rotation_angle = 0;
  }
  return changed;
}

std::vector<std::size_t> thinned_points(const Scene& scene, std::size_t source, std::size_t count, double group) {
  const Random random(scene.seed, RandomPurpose::particle_position, source);
  const auto rounded = static_cast<std::size_t>(std::llround(static_cast<double>(count) / group));
  const std::size_t groups = count == 0 ? 0 : std::max<std::size_t>(1, rounded);
  std::vector<std::size_t> kept;
  for (std::size_t g = 0; g < groups; ++g) {
    const std::size_t first = g * count / groups, end = (g + 1) * count / groups;
    kept.push_back(first + random.integer(g, 0, static_cast<uint32_t>(end - first)));
  }
  return kept;
}

/// The domain's faces move, so that the walls are again a whole number of cells inside.
Scene on_coarser_grid(const Scene& scene, double wanted_ratio, double particle_share) {
  Scene coarse = scene;
  const double ratio = ratio_of_whole_cells(scene.domain, wanted_ratio);
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  const auto divided = [&](int64_t n) { return static_cast<int64_t>(std::ceil(static_cast<double>(n) / ratio)); };
  coarse.domain.dx = ratio * scene.domain.dx;
  coarse.domain.wall_cells = std::max<int64_t>(2, divided(scene.domain.wall_cells));
  const Vec3d margin = coarse.domain.wall_distance();
  coarse.domain.origin = low - margin;
  coarse.domain.size = high - low + 2.0 * margin;
  coarse.obstacle_voxel = scene.voxel();
  coarse.obstacle_band = std::max(scene.band(), 4 * coarse.domain.dx);
  coarse.time_step.substeps_per_frame = std::max<int64_t>(1, divided(scene.time_step.substeps_per_frame));
  const double volumes = coarse.domain.cell_volume() / scene.domain.cell_volume();
  const double share = std::min(particle_share, volumes), group = volumes / share;
  keep_flux(scene, coarse, share);
  for (std::size_t s = 0; s < coarse.sources.size(); ++s) {
    Source& source = coarse.sources[s];
    source.particles_per_cell *= share;
    if (source.shape != Shape::points || !source.points) continue;
    std::vector<Vec3d> kept;
    for (const std::size_t p : thinned_points(scene, s, source.points->size(), group))
      kept.push_back((*source.points)[p]);
    source.points = std::make_shared<const std::vector<Vec3d>>(std::move(kept));
  }
  return coarse;
}

Scene coarse_variant(const Scene& scene) { return on_coarser_grid(scene, 2); }

}  // namespace graupel::mpm
