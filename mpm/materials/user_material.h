// A constitutive law of the caller's own, beside those of mpm/materials/list.h. The solver on the CPU calls it for
// every particle in every substep; what it costs stands in docs/guide/library.md.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "core/math/mat.h"

namespace graupel {

/// What a particle of a user's material carries: the elastic deformation gradient, and one number for the law's own use
/// (hardening, damage).
struct MaterialState {
  Mat3d F = Mat3d::identity();
  double internal = 0;
};

/// The step that led to a trial state.
struct MaterialStep {
  double dt;                ///< [s]
  Mat3d velocity_gradient;  ///< C [1/s]; the trial F is (I + dt C) F of the step before
};

/// Called from several threads at once: no function may change the object. What one throws comes out of the run's
/// advance_frame(); the run is then of no more use. In two dimensions F and the stress are those of plane strain, with
/// F(2, 2) = 1.
class UserMaterial {
 public:
  virtual ~UserMaterial() = default;
  /// Kirchhoff stress tau = P F^T [Pa], symmetric, of the trial state. A law with plasticity changes the state first.
  virtual Mat3d stress(const MaterialStep& step, MaterialState& state) const = 0;
  /// Largest wave speed [m/s], from which the solver chooses its steps: sqrt((lambda + 2 mu) / density) at rest.
  virtual double sound_speed(const MaterialState& state) const = 0;
  /// Elastic energy density [J/m^3 of reference volume], for diagnostics alone.
  virtual double energy(const MaterialState&) const { return 0; }
  /// MaterialState::internal at the start.
  virtual double initial_internal() const { return 0; }
};

/// Laws by the names of the scene's materials, which they replace. Density and particle type stay the scene's.
using UserMaterials = std::map<std::string, std::shared_ptr<const UserMaterial>>;

}  // namespace graupel
