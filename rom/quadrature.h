// The particles that integration points are chosen from, and how much of the body each stands for.
#pragma once

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace graupel::rom {

struct Quadrature {
  std::vector<int32_t> particles;  ///< ascending
  std::vector<double> share;       ///< > 0; mass and volume over the particle's own; all 1: everyone for itself
};

/// Every particle of the body.
Quadrature all_particles(int64_t count);
/// One of `step` particles, spread evenly over the body (every step-th along a curve that fills space); each stands for
/// all particles that it is nearest to in the reference body.
Quadrature thinned_particles(const std::vector<Vec3f>& reference, const std::vector<double>& volume, int step);

}  // namespace graupel::rom
