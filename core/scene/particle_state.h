// Particles that are given one by one, with all that a run can start from.
#pragma once

#include <string>
#include <vector>

#include "core/math/mat.h"
#include "core/math/vec.h"

namespace graupel {

/// One entry a particle, or an empty list where the default holds.
struct ParticleState {
  std::vector<Vec3d> position;                ///< [m]
  std::vector<Vec3d> velocity = {};           ///< [m/s]; default at rest
  std::vector<Mat3d> deformation_gradient{};  ///< elastic part of F; default the identity. Fluids take J = det F
  std::vector<Mat3d> affine_velocity{};       ///< C of APIC [1/s]; default 0
  std::vector<double> plastic = {};           ///< internal variable (ParticleField::plastic); default undeformed
  std::vector<double> volume = {};            ///< reference volume [m^3]; default that of a cell / 8
  std::vector<std::string> material = {};     ///< key of the scene's materials; one entry: of all particles
};

}  // namespace graupel
