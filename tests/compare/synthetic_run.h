// Scenes and runs made by formula, for tests with known answers.
#pragma once

#include <functional>

#include "compare/metrics/particle_run.h"
#include "core/scene/scene.h"

namespace graupel::compare {

/// Unit box with dx = 1/32 and no obstacle.
inline Scene unit_scene() {
  Scene scene;
  scene.name = "unit";
  scene.domain.dx = 1.0 / 32;
  return scene;
}

/// Adds a sphere of radius 0.15 m standing in the middle of the floor region, centre (0.5, 0.3, 0.5).
inline Scene scene_with_sphere() {
  Scene scene = unit_scene();
  Obstacle sphere;
  sphere.shape = Shape::sphere;
  sphere.radius = 0.15;
  sphere.position = {0.5, 0.3, 0.5};
  scene.obstacles.push_back(sphere);
  return scene;
}

/// Particles at path(start, frame) over `frames` predicted frames; mass 2 kg and volume 1e-4 m^3 each.
inline ParticleRun make_run(const std::vector<Vec3f>& start, const std::vector<int32_t>& type, std::size_t frames,
                            const std::function<Vec3f(const Vec3f&, std::size_t)>& path) {
  ParticleRun run;
  run.trajectory.particle_type = type;
  run.trajectory.frame_time = 1.0 / 60;
  run.mass.assign(start.size(), 2);
  run.volume.assign(start.size(), 1e-4);
  for (std::size_t f = 0; f <= frames; ++f) {
    ParticleFrame frame;
    frame.time = static_cast<double>(f) / 60;
    for (const Vec3f& x : start) frame.position.push_back(path(x, f));
    run.trajectory.frames.push_back(frame);
  }
  return run;
}

inline Vec3f stay(const Vec3f& x, std::size_t) { return x; }

/// n^3 points in a box with corner `low` and edge `edge`, at the centres of its cells.
inline std::vector<Vec3f> block(int n, const Vec3f& low, float edge) {
  std::vector<Vec3f> points;
  const float h = edge / static_cast<float>(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        points.push_back(low + Vec3f{(float(i) + 0.5f) * h, (float(j) + 0.5f) * h, (float(k) + 0.5f) * h});
  return points;
}

}  // namespace graupel::compare
