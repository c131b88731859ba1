#include "library/python/contact_forces.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <atomic>
#include <utility>

namespace graupel::python {

namespace {

uint64_t next_start() {
  static std::atomic<uint64_t> starts = 0;
  return ++starts;
}

constexpr std::pair<const char*, Vec3d ContactForce::*> quantities[] = {{"impulse", &ContactForce::impulse},
                                                                        {"force", &ContactForce::force},
                                                                        {"torque", &ContactForce::torque},
                                                                        {"reference", &ContactForce::reference}};

/// [names, 3] of one frame.
void add_to(std::vector<double>& values, const std::vector<ContactForce>& forces, Vec3d ContactForce::*member) {
  for (const ContactForce& one : forces)
    for (int d = 0; d < 3; ++d) values.push_back((one.*member)[d]);
}

}  // namespace

ContactSums::ContactSums(std::vector<ContactForce> forces, double time)
    : last_(std::move(forces)),
      impulse_(last_.size(), Vec3d::zero()),
      moment_impulse_(last_.size(), Vec3d::zero()),
      start_(next_start()),
      start_time_(time),
      time_(time) {}

void ContactSums::add(const std::vector<ContactForce>& forces, double time, bool whole) {
  for (std::size_t i = 0; i < forces.size(); ++i) {
    impulse_[i] += forces[i].impulse;
    moment_impulse_[i] += (time - time_) * forces[i].torque;
  }
  last_ = forces;
  time_ = time;
  frames_ += whole ? 1 : 0;
  whole_ = whole;
}

std::vector<ContactForce> ContactSums::since(const ContactSums& before) const {
  const bool same_run = before.start_ == start_;
  const int64_t frames = frames_ - (same_run ? before.frames_ : 0);
  if (frames == 1 && whole_ && (!same_run || before.whole_)) return last_;
  const double duration = time_ - (same_run ? before.time_ : start_time_);
  const double rate = duration > 0 ? 1 / duration : 0;
  std::vector<ContactForce> forces = last_;
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const Vec3d impulse = impulse_[i] - (same_run ? before.impulse_[i] : Vec3d::zero());
    const Vec3d moment = moment_impulse_[i] - (same_run ? before.moment_impulse_[i] : Vec3d::zero());
    forces[i] = {impulse, rate * impulse, rate * moment, last_[i].reference};
  }
  return forces;
}

nb::dict contact_dict(const std::vector<std::string>& names, const std::vector<ContactForce>& forces) {
  nb::dict found;
  found["names"] = names;
  for (const auto& [name, member] : quantities) {
    std::vector<double> values;
    add_to(values, forces, member);
    found[name] = array_of(std::move(values), {forces.size(), 3});
  }
  return found;
}

nb::dict contact_dict(const std::vector<std::string>& names, const std::vector<std::vector<ContactForce>>& frames) {
  nb::dict found;
  found["names"] = names;
  for (const auto& [name, member] : quantities) {
    std::vector<double> values;
    for (const std::vector<ContactForce>& forces : frames) add_to(values, forces, member);
    found[name] = array_of(std::move(values), {frames.size(), names.size(), 3});
  }
  return found;
}

}  // namespace graupel::python
