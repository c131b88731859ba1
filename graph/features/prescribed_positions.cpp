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
    (moves_by_itself(particle_type[i]) ? others_ : prescribed_).push_back(i);
  if (given_ == nullptr) return;
  for (const std::vector<Vec3f>& frame : *given_)
    if (frame.size() != particle_type.size())
      throw InputError("a frame that gives the places of held particles has another number of particles (" +
                       std::to_string(frame.size()) + ", particle types " + std::to_string(particle_type.size()) +
                       "). Use frames of the same trajectory");
}

void PrescribedPositions::refuse_gpu() const {
  if (any())
    throw ConfigError("rollouts on a GPU know no particles that are held in place, of obstacles or stationary (" +
                      std::to_string(prescribed_.size()) + " of " +
                      std::to_string(prescribed_.size() + others_.size()) + ", allowed: none). Use --device cpu");
}

void PrescribedPositions::put(int64_t frame, std::vector<Vec3f>& position) const {
  const std::vector<Vec3f>& places =
      given_ == nullptr
          ? start_
          : (*given_)[static_cast<std::size_t>(std::min<int64_t>(frame, static_cast<int64_t>(given_->size())) - 1)];
  for (const std::size_t i : prescribed_) position[i] = places[i];
}

std::vector<Vec3f> PrescribedPositions::others(const std::vector<Vec3f>& position) const {
  if (!any()) return position;
  std::vector<Vec3f> others;
  others.reserve(others_.size());
  for (const std::size_t i : others_) others.push_back(position[i]);
  return others;
}

void PrescribedPositions::put_others(const std::vector<Vec3f>& others, std::vector<Vec3f>& position) const {
  GRAUPEL_ASSERT(others.size() == others_.size());
  for (std::size_t k = 0; k < others_.size(); ++k) position[others_[k]] = others[k];
}

}  // namespace graupel::graph
