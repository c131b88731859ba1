// Scenes and random tensors for the tests of this folder.
#pragma once

#include "core/math/random.h"
#include "mpm/sampling.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

inline MaterialConfig preset(const std::string& name) {
  MaterialConfig m = *material_preset(name);
  m.name = name;
  return m;
}

inline Source box_source(const std::string& material, const Vec3d& centre, const Vec3d& size) {
  Source source;
  source.shape = Shape::box;
  source.size = size;
  source.position = centre;
  source.material = material;
  return source;
}

/// A scene with one box of a preset material and Taichi's fixed 54 substeps.
inline Scene scene_with(const std::string& material, const Vec3d& centre = {0.5, 0.5, 0.5}, double size = 0.08) {
  Scene scene;
  scene.materials[material] = preset(material);
  scene.sources.push_back(box_source(material, centre, Vec3d::filled(size)));
  scene.time_step.policy = StepPolicy::fixed;
  return scene;
}

inline void add_box(Scene& scene, const std::string& material, const Vec3d& centre, double size = 0.08) {
  scene.materials[material] = preset(material);
  scene.sources.push_back(box_source(material, centre, Vec3d::filled(size)));
}

/// Fixed substeps of dt [s].
inline void set_steps(Scene& scene, int substeps, double dt) {
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = substeps;
  scene.frame_time = substeps * dt;
}

/// Four materials that meet each other, the floor and a ball.
inline Scene four_materials(double size = 0.08) {
  Scene scene = scene_with("taichi_water", {0.36, 0.11, 0.4}, size);
  add_box(scene, "taichi_sand", {0.47, 0.23, 0.42}, size);
  add_box(scene, "taichi_snow", {0.58, 0.12, 0.43}, size);
  add_box(scene, "taichi_jelly", {0.4, 0.12, 0.5}, size);
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.05;
  ball.position = {0.46, 0.1, 0.4};
  ball.friction = 0.2;
  scene.obstacles.push_back(ball);
  for (Source& source : scene.sources) source.velocity = {0.4, -1.5, 0};
  set_steps(scene, 20, 3e-4);
  return scene;
}

/// Small boxes of every model beyond Taichi Elements' four, thrown at the floor and each other, on a stationary one.
inline Scene every_model() {
  Scene scene = scene_with("stationary", {0.45, 0.07, 0.45}, 0.04);
  const char* names[] = {"neo_hookean", "metal",      "cake",     "toothpaste", "foam",
                         "honey",       "tait_water", "wet_sand", "snow"};
  int i = 0;
  for (const char* name : names) {
    add_box(scene, name, {0.4 + 0.05 * (i % 3), 0.13, 0.4 + 0.05 * (i / 3)}, 0.045);
    scene.sources.back().velocity = {0.2, -2, 0.1};
    ++i;
  }
  scene.frame_time = 4e-3;
  scene.time_step.policy = StepPolicy::adaptive;
  return scene;
}

/// The scene with two dimensions: bodies that reach the plane in the middle of the domain, as thick as they are wide,
/// and with no velocity across it.
inline Scene in_the_plane(Scene scene) {
  scene.domain.dimensions = 2;
  scene.gravity[2] = 0;
  for (Source& source : scene.sources) {
    source.position[2] = scene.domain.plane();
    source.velocity[2] = 0;
  }
  return scene;
}

inline FieldSet all_fields() {
  FieldSet fields;
  for (const ParticleField field : all_particle_fields) fields.add(field);
  return fields;
}

template <typename T, int D>
Mat<T, D> random_matrix(uint64_t i, double scale) {
  const Random random(11, RandomPurpose::test, D);
  Mat<T, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) m(r, c) = static_cast<T>(scale * random.uniform(16 * i + r * D + c, 0, -1, 1));
  return m;
}

template <typename T, int D>
T largest_entry(const Mat<T, D>& m) {
  T worst = 0;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) worst = std::max(worst, std::abs(m(r, c)));
  return worst;
}

}  // namespace graupel::mpm
