// Reduced-order models at other points of their body than their own particles: those of a scene that has the same body
// with other particles, and those of a finer output.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"
#include "experiments/models/reduced_model.h"
#include "rom/interpolation/mls_interpolation.h"

namespace graupel::experiments {

/// Scene keys that say with which particles and on which grid a body is run, as JSON pointers.
std::set<std::string> discretisation_keys(const std::string& scene_json);

/// Whether a scene's particles are those of the model, within so much [m].
bool has_own_particles(const rom::ReducedModel& model, const mpm::SampledParticles& particles, double tolerance);

/// The model's particles in a scene with the same body and others: placed as in the training, led as in the scene.
mpm::SampledParticles own_particles(const rom::ReducedModel& model, const Scene& scene);

/// A scene's particles, for interpolation between them.
rom::MlsParticles interpolation_particles(const Scene& scene, const mpm::SampledParticles& sampled);

/// Frames of points that a deformation is bound to.
class PointFrames {
 public:
  enum class Content { positions, positions_and_velocities };

  PointFrames(std::unique_ptr<rom::PointPositions<float>> points, std::size_t count, Content content);
  ParticleFrame frame(const rom::LatentState& state, double time) const;

 private:
  std::unique_ptr<rom::PointPositions<float>> points_;
  std::size_t count_;
  Content content_;
};

}  // namespace graupel::experiments
