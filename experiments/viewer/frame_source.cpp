#include "experiments/viewer/frame_source.h"

#include <algorithm>

namespace graupel::experiments {

std::size_t RunFacts::moving_obstacles() const {
  if (!scene) return 0;
  return static_cast<std::size_t>(std::count_if(scene->obstacles.begin(), scene->obstacles.end(),
                                                [](const Obstacle& obstacle) { return obstacle.motion.has_value(); }));
}

Box RunFacts::limits() const {
  float longest = 0;
  for (int d = 0; d < 3; ++d) longest = std::max(longest, box.high[d] - box.low[d]);
  return {box.low - Vec3f::filled(longest), box.high + Vec3f::filled(longest)};
}

std::vector<RigidMap> RunFacts::obstacle_poses(double time) const {
  std::vector<RigidMap> poses;
  if (!scene) return poses;
  for (const Obstacle& obstacle : scene->obstacles)
    if (obstacle.motion) poses.push_back(obstacle.motion->at(time, obstacle.position));
  return poses;
}

void set_scene(RunFacts& facts, const Scene& scene) {
  facts.scene = scene;
  facts.dimensions = static_cast<int>(scene.domain.dimensions);
  facts.box = {scene.wall_low().cast<float>(), scene.wall_high().cast<float>()};
  const auto take = [&](double per_cell) { facts.spacing = std::max(facts.spacing, scene.domain.spacing(per_cell)); };
  for (const Source& source : scene.sources) take(source.particles_per_cell);
  for (const Emitter& emitter : scene.emitters) take(emitter.particles_per_cell);
}

}  // namespace graupel::experiments
