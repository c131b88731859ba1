#include "compare/pictures/player_track.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "compare/pictures/raster.h"
#include "core/math/random.h"

namespace graupel::compare {

namespace {

constexpr std::size_t bytes_per_position = 6;
constexpr uint16_t not_in_run = 65535;  ///< on all axes: the player leaves the particle out

uint16_t quantize(double x, double low, double size) {
  return static_cast<uint16_t>(std::lround(65535 * std::clamp((x - low) / size, 0.0, 1.0)));
}

/// `count` of 0..n-1, ascending, drawn without repetition; the same for the same n and count.
std::vector<std::size_t> subset(std::size_t n, std::size_t count) {
  std::vector<std::size_t> index(n);
  std::iota(index.begin(), index.end(), std::size_t(0));
  if (count >= n) return index;
  const Random random(0, RandomPurpose::metric_subset);
  for (std::size_t i = 0; i < count; ++i)
    std::swap(index[i], index[i + random.integer(i, 0, static_cast<uint32_t>(n - i))]);
  index.resize(count);
  std::sort(index.begin(), index.end());
  return index;
}

}  // namespace

Thinning choose_thinning(std::size_t particles, std::size_t frames, std::size_t budget) {
  const std::size_t entries = std::max<std::size_t>(1, budget / bytes_per_position);
  Thinning t{particles, 1};
  constexpr std::size_t enough_frames = 30;
  while (t.particles * (frames / t.frame_stride + 1) > entries && frames / t.frame_stride > enough_frames)
    ++t.frame_stride;
  const std::size_t wanted = t.particles * (frames / t.frame_stride + 1);
  const double excess = static_cast<double>(wanted) / static_cast<double>(entries);
  if (excess > 1) {
    if (excess > 4) t.frame_stride *= static_cast<std::size_t>(std::ceil(std::sqrt(excess / 4)));
    t.particles = std::max<std::size_t>(1, std::min(particles, entries / (frames / t.frame_stride + 1)));
  }
  return t;
}

PlayerTrack make_track(const Scene& scene, const ParticleRun& run, const std::string& label, const Thinning& thinning) {
  PlayerTrack track;
  track.label = label;
  track.all_particles = run.size();
  const auto index = subset(run.size(), thinning.particles);
  track.particles = index.size();
  double volume = 0;
  for (const std::size_t i : index) {
    track.type.push_back(static_cast<uint8_t>(run.trajectory.particle_type[i]));
    volume += run.volume[i];
  }
  const double fraction = static_cast<double>(index.size()) / static_cast<double>(run.size());
  track.radius = sphere_radius(volume / static_cast<double>(index.size())) / std::cbrt(fraction);
  const Domain& domain = scene.domain;
  for (std::size_t f = 0; f <= run.predicted(); f += thinning.frame_stride) {
    track.frames.push_back(static_cast<int64_t>(f));
    for (const std::size_t i : index)
      for (int d = 0; d < 3; ++d)
        track.position.push_back(
            run.is_active(f, i)
                ? std::min<uint16_t>(quantize(run.position(f)[i][d], domain.origin[d], domain.size[d]), not_in_run - 1)
                : not_in_run);
  }
  return track;
}

bool halve_frames(PlayerTrack& track) {
  if (track.frames.size() <= 2) return false;
  const std::size_t row = 3 * track.particles;
  std::size_t kept = 0;
  for (std::size_t f = 0; f < track.frames.size(); f += 2, ++kept) {
    track.frames[kept] = track.frames[f];
    std::copy_n(track.position.begin() + static_cast<std::ptrdiff_t>(f * row), row,
                track.position.begin() + static_cast<std::ptrdiff_t>(kept * row));
  }
  track.frames.resize(kept);
  track.position.resize(kept * row);
  return true;
}

PlayerObstacles make_player_obstacles(const Scene& scene, const sparsegrid::ObstacleSet& obstacles,
                                      std::size_t most_points) {
  PlayerObstacles points;
  if (obstacles.count() == 0) return points;
  const Vec3d low = scene.wall_low(), size = scene.wall_high() - low;
  // Lattice points near the surface, moved onto it; the lattice widens until they are few enough.
  for (double spacing = scene.domain.dx / 2;; spacing *= 1.4) {
    points = {};
    points.radius = 0.75 * spacing;
    Vec3i count;
    for (int d = 0; d < 3; ++d) count[d] = static_cast<int>(size[d] / spacing) + 1;
    for (int i = 0; i < count[0]; ++i)
      for (int j = 0; j < count[1]; ++j)
        for (int k = 0; k < count[2]; ++k) {
          const Vec3d x = low + Vec3d{i * spacing, j * spacing, k * spacing};
          const auto distance = obstacles.sample(x);
          if (std::abs(distance.phi) > 0.6 * spacing) continue;
          const Vec3d on_surface = x - distance.normal * distance.phi;
          for (int d = 0; d < 3; ++d) {
            points.position.push_back(quantize(on_surface[d], scene.domain.origin[d], scene.domain.size[d]));
            points.normal.push_back(static_cast<int8_t>(std::lround(127 * distance.normal[d])));
          }
        }
    if (points.position.size() <= 3 * most_points) return points;
  }
}

}  // namespace graupel::compare
