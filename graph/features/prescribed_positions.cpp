#include "graph/features/prescribed_positions.h"

#include <algorithm>
#include <string>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"

namespace graupel::graph {

PrescribedPositions::PrescribedPositions(const std::vector<int32_t>& particle_type, const std::vector<Vec3f>& start,
                                         const std::vector<std::vector<Vec3f>>* given)
    : start_(start), given_(given != nullptr && !given->empty() ? given : nullptr) {
  for (std::size_t i = 0; i < particle_type.size(); ++i)
    if (!moves_by_itself(particle_type[i])) prescribed_.push_back(i);
  if (given_ == nullptr) return;
  for (const std::vector<Vec3f>& frame : *given_)
    if (frame.size() != particle_type.size())
      throw InputError("a frame that gives the places of kinematic particles has another number of particles (" +
                       std::to_string(frame.size()) + ", particle types " + std::to_string(particle_type.size()) +
                       "). Use frames of the same trajectory");
}

void PrescribedPositions::add_scripts(const ParticleSchedule& schedule, double start_time, double frame_time,
                                      bool in_plane) {
  scripts_ = schedule.scripts;
  start_time_ = start_time;
  frame_time_ = frame_time;
  in_plane_ = in_plane;
  for (std::size_t i = 0; i < schedule.script.size(); ++i)
    if (schedule.script[i] >= 0 && leads(scripts_[static_cast<std::size_t>(schedule.script[i])], 0))
      scripted_.push_back({i, schedule.script[i]});
}

/// Up to the last frame that is not after the release.
bool PrescribedPositions::leads(const ParticleScript& script, int64_t frame) const {
  return time_of(frame) <= script.release_time + 1e-6 * frame_time_;
}

std::vector<uint8_t> PrescribedPositions::mask(int64_t frame) const {
  std::vector<uint8_t> mask;
  if (!any()) return mask;
  mask.resize(start_.size());
  for (const std::size_t i : prescribed_) mask[i] = 1;
  for (const Scripted& one : scripted_)
    if (leads(scripts_[static_cast<std::size_t>(one.script)], frame)) mask[one.particle] = 1;
  if (std::find(mask.begin(), mask.end(), 1) == mask.end()) mask.clear();
  return mask;
}

void PrescribedPositions::put(int64_t frame, std::vector<Vec3f>& position) const {
  const std::vector<Vec3f>& places =
      given_ == nullptr
          ? start_
          : (*given_)[static_cast<std::size_t>(std::min<int64_t>(frame, static_cast<int64_t>(given_->size())) - 1)];
  for (const std::size_t i : prescribed_) position[i] = places[i];
  if (scripted_.empty()) return;
  std::vector<RigidMap> start, now;
  for (const ParticleScript& script : scripts_) {
    start.push_back(script.motion.at(start_time_, script.body_center));
    now.push_back(script.motion.at(time_of(frame), script.body_center));
  }
  for (const Scripted& one : scripted_) {
    const auto s = static_cast<std::size_t>(one.script);
    if (!leads(scripts_[s], frame)) continue;
    const Vec3d x = start_[one.particle].cast<double>();
    position[one.particle] = now[s](transpose(start[s].rotation) * (x - start[s].translation)).cast<float>();
    if (in_plane_) position[one.particle][2] = start_[one.particle][2];
  }
}

}  // namespace graupel::graph
