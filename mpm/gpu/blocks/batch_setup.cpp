#include "mpm/gpu/blocks/batch_setup.h"

#include <cmath>

#include "core/system/error.h"

namespace graupel::mpm {

BatchSetup set_up_batch(std::vector<BatchEntry> entries, Device device) {
  GRAUPEL_ASSERT(!entries.empty());
  BatchSetup batch;
  for (BatchEntry& entry : entries) {
    const auto first = static_cast<int64_t>(batch.particles.size());
    batch.scenes.push_back(
        std::make_unique<SceneSetup<float>>(std::move(entry.scene), entry.particles, entry.obstacles, device));
    const SceneSetup<float>& s = *batch.scenes.back();
    batch.first_particle.push_back(first);
    HostParticles<float> own = initial_particles<float>(entry.particles, s.material_configs);
    for (int32_t& index : own.source_index) index += static_cast<int32_t>(first);
    batch.records.push_back({s.view(), s.scene.time_step, s.scene.frame_time, s.diffusivity,
                             norm(s.scene.gravity) * s.scene.frame_time, static_cast<int32_t>(first)});
    SceneProgress control{};
    control.phase = ScenePhase::frame_done;
    control.bad_particle = no_bad_particle;
    const StepStatistics step_statistics = survey_start(s, own);
    control.speed = std::sqrt(step_statistics.largest_speed2);
    control.sound_speed = step_statistics.largest_sound_speed;
    batch.controls.push_back(control);
    append(batch.particles, own);
  }
  batch.first_particle.push_back(static_cast<int64_t>(batch.particles.size()));
  return batch;
}

ParticleFrame unpack_frame(const std::vector<float>& packed) {
  const std::size_t n = packed.size() / 6;
  ParticleFrame frame;
  frame.position.resize(n);
  frame.velocity.resize(n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t d = 0; d < 3; ++d) {
      frame.position[i][static_cast<int>(d)] = packed[3 * i + d];
      frame.velocity[i][static_cast<int>(d)] = packed[3 * (n + i) + d];
    }
  return frame;
}

}  // namespace graupel::mpm
