// The scenes of a batch as its solvers start from them: setups, particles one scene after the other, records.
#pragma once

#include <memory>
#include <vector>

#include "mpm/gpu/blocks/batch_view.h"
#include "mpm/particles/host_particles.h"
#include "mpm/scene/scene_setup.h"

namespace graupel::mpm {

/// A scene with what is built of it before a run.
struct BatchEntry {
  Scene scene;
  SampledParticles particles;
  sparsegrid::ObstacleSet obstacles;
};

struct BatchSetup {
  std::vector<std::unique_ptr<SceneSetup<float>>> scenes;
  std::vector<int64_t> first_particle;  ///< of every scene, and one past the last scene's
  HostParticles<float> particles;       ///< source_index counts through all scenes
  std::vector<BatchScene> records;
  std::vector<SceneProgress> controls;
};

BatchSetup set_up_batch(std::vector<BatchEntry> entries, Device device);

/// Positions [m] and velocities [m/s] from packed arrays, [n, 3] each.
ParticleFrame unpack_frame(const std::vector<float>& packed);

}  // namespace graupel::mpm
