// Small scenes as a user of the library makes them.
#pragma once

#include <graupel/io.h>

namespace graupel::test {

/// A spinning block in the middle of a box, 40 equal substeps a frame.
inline Scene spinning_block(const std::string& preset, const std::string& changes = "") {
  Scene scene;
  scene.name = "block";
  scene.domain.size = {0.48, 0.48, 0.48};
  scene.domain.dx = 0.02;
  scene.materials["matter"] = *material_preset(preset);
  Source block;
  block.material = "matter";
  block.size = {0.16, 0.08, 0.08};
  block.position = {0.24, 0.24, 0.24};
  block.sampling = Sampling::jittered_lattice;
  block.angular_velocity = {0, 0, 6};
  scene.sources.push_back(block);
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = 40;
  scene.frames = 4;
  return changes.empty() ? checked_scene(scene) : io::parse_scene(io::scene_to_json(scene), "block", ".", {changes});
}

}  // namespace graupel::test
