// What the matter does to obstacles and walls: between two stored frames of a run, and as arrays.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/contact_force.h"
#include "library/python/binding.h"

namespace graupel::python {

/// Sums over a run since its start or its last load_state().
class ContactSums {
 public:
  /// `forces`: contact_forces() of a run that begins, or goes on from a state, at `time` [s].
  ContactSums(std::vector<ContactForce> forces, double time);

  /// contact_forces() at `time` [s]: of a `whole` frame, or of the part of one that is done.
  void add(const std::vector<ContactForce>& forces, double time, bool whole);
  /// From `before` to these sums, or from their start where `before` is of another run or state. Of one whole frame the
  /// forces that add() was given, to the bit.
  std::vector<ContactForce> since(const ContactSums& before) const;

 private:
  std::vector<ContactForce> last_;               ///< those added last
  std::vector<Vec3d> impulse_, moment_impulse_;  ///< [N s], and about the points of reference [N m s]
  uint64_t start_;                               ///< tells starts apart
  double start_time_, time_;                     ///< [s]
  int64_t frames_ = 0;                           ///< whole ones
  bool whole_ = true;                            ///< no part of a frame is in them
};

/// 'names' [k], and f64 [k, 3] 'impulse', 'force', 'torque', 'reference'.
nb::dict contact_dict(const std::vector<std::string>& names, const std::vector<ContactForce>& forces);
/// The same of many frames: [frames, k, 3].
nb::dict contact_dict(const std::vector<std::string>& names, const std::vector<std::vector<ContactForce>>& frames);

}  // namespace graupel::python
