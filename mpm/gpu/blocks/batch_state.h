// Saving and restoring a BatchSolver or SmallSceneSolver between two frames, bit for bit: the scenes' records, the
// particle arrays in slot order, and who is present. Every frame starts with a stable sort by cell, so the order of the
// slots and these records fix all sums; block lists and storage are made anew.
#pragma once

#include <vector>

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

/// Returns the frames done. Throws InputError for a state of another owner or a damaged one.
template <typename Batch>
int64_t load_batch(Batch& batch, const StateOwner& owner, const std::vector<std::byte>& state) {
  StateReader reader(state, owner, batch_state_bytes(batch));
  int64_t frames_done = 0;
  std::vector<SceneProgress> controls(static_cast<std::size_t>(batch.scene_count()));
  reader.get(frames_done);
  reader.get(controls);
  batch.present_particles().for_each_buffer([&](auto& buffer) { reader.get(buffer); });
  for (int scene = 0; scene < batch.scene_count(); ++scene) reader.get(batch.presence(scene));
  batch.set_course(controls, frames_done);
  return frames_done;
}

}  // namespace graupel::mpm
