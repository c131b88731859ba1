// The particles near a place, by cells: how many they are, and their average velocity.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/math/vec.h"

namespace graupel::io {

class NearParticles {
 public:
  /// "Near" is within `radius` [m]. `velocity` is [n, 3] as `position` [m/s], or empty. Keeps copies in the order of
  /// the cells.
  NearParticles(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity, double radius);

  bool has_velocities() const { return !velocity_.empty(); }
  /// Number of particles near a place; counting ends at `most`.
  int count(const Vec3f& place, int most) const;
  /// sum w_p v_p / sum w_p with w_p = (1 - |x - x_p|^2 / radius^2)^3 (the kernel of Mueller et al. 2003) [m/s]: one
  /// velocity of all particles is that of every place. Zero where no particle is near.
  Vec3f velocity(const Vec3f& place) const;

 private:
  struct Range {
    uint32_t first = 0, end = 0;
  };
  int64_t cell_along(float x) const;
  /// visit(particle, 1 - |x - x_p|^2 / radius^2) of each that is near, until it returns false.
  template <typename Visitor>
  void for_each(const Vec3f& place, const Visitor& visit) const;

  double radius_;
  std::vector<Vec3f> position_, velocity_;
  std::unordered_map<uint64_t, Range> cells_;  ///< of edge `radius`
};

}  // namespace graupel::io
