// Sizes of surfaces of particles: what is sensible, what is allowed, what it takes of memory.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/system/error.h"
#include "io/config/config_document.h"
#include "io/surface/particle_surface.h"

namespace graupel::io {

namespace {

constexpr double band_voxels = 3;     ///< half width of OpenVDB's narrow bands
constexpr double block_edge = 8;      ///< voxels along an edge of a leaf of OpenVDB's trees
constexpr double block_bytes = 8192;  ///< two level sets, a filter's copy, the signs and indices of meshing

void check_range(const char* option, double value, double low, double high, const char* meaning) {
  if (value >= low && value <= high) return;
  throw ConfigError(std::string(option) + " " + number_text(value) + " is out of range (allowed: " + number_text(low) +
                    " to " + number_text(high) + ", " + meaning + "). Choose a value in it, or leave it out");
}

/// Number of cubes of edge `edge` that hold particles or touch one that does. A cube's key has 21 bits an axis, which
/// may wrap around: that only joins cubes that are far apart.
double touched_cubes(const std::vector<Vec3f>& position, double edge) {
  constexpr uint64_t mask = (1u << 21) - 1, step[] = {uint64_t(1) << 42, uint64_t(1) << 21, 1};
  std::vector<uint64_t> cubes;
  const auto keep_unique = [&] {
    std::sort(cubes.begin(), cubes.end());
    cubes.erase(std::unique(cubes.begin(), cubes.end()), cubes.end());
  };
  cubes.reserve(position.size());
  for (const Vec3f& p : position) {
    uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)
      key |= (static_cast<uint64_t>(static_cast<int64_t>(std::floor(p[axis] / edge))) & mask) * step[axis];
    cubes.push_back(key);
  }
  keep_unique();
  for (const uint64_t one : step) {
    const std::size_t count = cubes.size();
    for (std::size_t i = 0; i < count; ++i) {
      cubes.push_back(cubes[i] - one);
      cubes.push_back(cubes[i] + one);
    }
    keep_unique();
  }
  return static_cast<double>(cubes.size());
}

}  // namespace

SurfaceSettings default_surface_settings(double spacing) {
  return {.spacing = spacing, .radius = 1.5 * spacing, .voxel = 0.5 * spacing};
}

void check_surface_settings(const SurfaceSettings& s) {
  check_range("--radius", s.radius, 0.5 * s.spacing, 8 * s.spacing, "half to eight times the particles' spacing");
  check_range("--voxel", s.voxel, s.radius / 16, s.radius / 1.5, "a sixteenth to two thirds of the radius");
  check_range("--smoothing", s.smoothing, 0, 100, "passes");
}

double surface_bytes(const std::vector<Vec3f>& position, const SurfaceSettings& s) {
  const double block = block_edge * s.voxel, reach = s.radius + band_voxels * s.voxel;
  const double blocks_along_cube = std::ceil(reach / block);
  return touched_cubes(position, blocks_along_cube * block) * std::pow(blocks_along_cube, 3) * block_bytes;
}

}  // namespace graupel::io
