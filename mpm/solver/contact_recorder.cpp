#include "mpm/solver/contact_recorder.h"

#include <algorithm>

namespace graupel::mpm {

template <typename T>
ContactRecorder<T>::ContactRecorder(Device device, const Scene& scene) : records_(device, 0) {
  scene_.domain = scene.domain;
  scene_.obstacles = scene.obstacles;
  impulse_.resize(contact_references(scene_, 0).size());
  angular_impulse_.resize(impulse_.size());
  begin_frame();
}

template <typename T>
void ContactRecorder<T>::begin_frame() {
  std::fill(impulse_.begin(), impulse_.end(), Vec3d::zero());
  std::fill(angular_impulse_.begin(), angular_impulse_.end(), Vec3d::zero());
  duration_ = 0;
}

template <typename T>
void ContactRecorder<T>::add_nodes(const SolverView<T>& view, double time, double dt) {
  add(node_contact_impulses(view, static_cast<int32_t>(scene_.obstacles.size()), static_cast<T>(dt), records_), time);
  duration_ += dt;
}

template <typename T>
void ContactRecorder<T>::add_push_out(const SolverView<T>& view, double time, double dt) {
  add(push_out_impulses(view, static_cast<int32_t>(scene_.obstacles.size()), static_cast<T>(dt), records_), time + dt);
}

/// Moments about the origin become those about the reference points at that time.
template <typename T>
void ContactRecorder<T>::add(const std::vector<ContactImpulse>& given, double time) {
  const std::vector<Vec3d> reference = contact_references(scene_, time);
  for (std::size_t i = 0; i < given.size(); ++i) {
    const Vec3d impulse = {given[i].impulse[0], given[i].impulse[1], given[i].impulse[2]};
    const Vec3d moment = {given[i].moment[0], given[i].moment[1], given[i].moment[2]};
    impulse_[i] += impulse;
    angular_impulse_[i] += moment - cross(reference[i], impulse);
  }
}

template <typename T>
std::vector<ContactForce> ContactRecorder<T>::forces(double time) const {
  const std::vector<Vec3d> reference = contact_references(scene_, time);
  const double rate = duration_ > 0 ? 1 / duration_ : 0;
  std::vector<ContactForce> forces;
  for (std::size_t i = 0; i < impulse_.size(); ++i)
    forces.push_back({impulse_[i], rate * impulse_[i], rate * angular_impulse_[i], reference[i]});
  return forces;
}

template class ContactRecorder<float>;
template class ContactRecorder<double>;

}  // namespace graupel::mpm
