// The forces of a run on its obstacles and walls: what the substeps of a frame give, added up in f64.
#pragma once

#include <vector>

#include "core/scene/contact_force.h"
#include "core/scene/scene.h"
#include "mpm/phases/contact_impulses.h"

namespace graupel::mpm {

template <typename T>
class ContactRecorder {
 public:
  ContactRecorder(Device device, const Scene& scene);

  /// Forgets what was added.
  void begin_frame();
  /// What the grid update of the substep of `dt` from `time` on [s] takes from the nodes; before it.
  void add_nodes(const SolverView<T>& view, double time, double dt);
  /// What its motion takes from particles that are kept out; before that.
  void add_push_out(const SolverView<T>& view, double time, double dt);
  /// Of the substeps since begin_frame(), in the order of contact_names(); `time` is the present one [s].
  std::vector<ContactForce> forces(double time) const;

 private:
  void add(const std::vector<ContactImpulse>& given, double time);

  Scene scene_;  ///< its domain and obstacles
  std::vector<Vec3d> impulse_, angular_impulse_;
  double duration_ = 0;  ///< of the substeps together [s]
  Buffer<ContactImpulse> records_;
};

extern template class ContactRecorder<float>;
extern template class ContactRecorder<double>;

}  // namespace graupel::mpm
