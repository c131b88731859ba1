// Saving and restoring a BatchSolver or SmallSceneSolver between two frames, bit for bit: the scenes' records, the
// particle arrays in slot order, and who is present. Every frame starts with a stable sort by cell, so the order of the
// slots and these records fix all sums; block lists and storage are made anew.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "mpm/gpu/blocks/batch_view.h"
#include "mpm/particles/particle_lifecycle.h"
#include "mpm/particles/state_bytes.h"

namespace graupel::mpm {

template <typename Batch>
std::size_t batch_state_bytes(Batch& batch) {
  std::size_t content = sizeof(int64_t) + static_cast<std::size_t>(batch.scene_count()) * sizeof(SceneProgress);
  batch.present_particles().for_each_buffer(
      [&](const auto& buffer) { content += buffer.size() * sizeof(*buffer.data()); });
  for (int scene = 0; scene < batch.scene_count(); ++scene) content += batch.presence(scene).size() * sizeof(Presence);
  return content;
}

template <typename Batch>
std::vector<std::byte> save_batch(Batch& batch, const StateOwner& owner, int64_t frames_done) {
  StateWriter writer(owner, batch_state_bytes(batch));
  writer.add(frames_done);
  for (int scene = 0; scene < batch.scene_count(); ++scene) writer.add(batch.control(scene));
  batch.present_particles().for_each_buffer([&](const auto& buffer) { writer.add(buffer); });
  for (int scene = 0; scene < batch.scene_count(); ++scene) writer.add(batch.presence(scene));
  return writer.finish();
}

/// Throws InputError for what no run leaves.
inline void check_course(const std::vector<SceneProgress>& controls, int64_t frames_done) {
  bool fits = frames_done >= 0;
  for (const SceneProgress& c : controls)
    fits = fits && c.elapsed >= 0 && std::isfinite(c.elapsed) && std::isfinite(c.dt) && std::isfinite(c.speed) &&
           std::isfinite(c.sound_speed) && c.phase >= ScenePhase::running && c.phase <= ScenePhase::too_stiff;
  if (!fits)
    throw InputError("the saved state is damaged (a scene's course after frame " + std::to_string(frames_done) +
                     "). Use an older one, or run again");
}

/// Returns the frames done; the particles are not looked at (mpm/particles/state_check.h). Throws InputError for a
/// state of another owner or a damaged one.
template <typename Batch>
int64_t load_batch(Batch& batch, const StateOwner& owner, const std::vector<std::byte>& state) {
  StateReader reader(state, owner, batch_state_bytes(batch));
  int64_t frames_done = 0;
  std::vector<SceneProgress> controls(static_cast<std::size_t>(batch.scene_count()));
  reader.get(frames_done);
  reader.get(controls);
  batch.present_particles().for_each_buffer([&](auto& buffer) { reader.get(buffer); });
  for (int scene = 0; scene < batch.scene_count(); ++scene) reader.get(batch.presence(scene));
  check_course(controls, frames_done);
  batch.set_course(controls, frames_done);
  return frames_done;
}

}  // namespace graupel::mpm
