// Scenes in which obstacles move and particles come and go, with few particles and 10 substeps a frame.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {

inline Scene changing_scene(const std::string& material, const Vec3d& centre, const Vec3d& velocity) {
  Scene scene = scene_with(material, centre, 0.05);
  scene.sources[0].velocity = velocity;
  scene.sources[0].particles_per_cell = 4;
  set_steps(scene, 10, 3e-4);
  return scene;
}

inline Obstacle moving_box(const Vec3d& position, const Vec3d& size, const Motion& motion, double friction = 0) {
  Obstacle box;
  box.position = position;
  box.size = size;
  box.friction = friction;
  box.motion = motion;
  return box;
}

/// Water falls on a blade that turns into a block at rest.
inline Scene turning_paddle() {
  Scene scene = changing_scene("taichi_water", {0.42, 0.165, 0.4}, {0, -4, 0});
  Motion motion;
  motion.spin = 40;
  motion.axis = {0, 0, 1};
  scene.obstacles.push_back(moving_box({0.44, 0.11, 0.4}, {0.12, 0.025, 0.1}, motion));
  Obstacle block;
  block.size = {0.06, 0.04, 0.06};
  block.position = {0.4, 0.075, 0.4};
  scene.obstacles.push_back(block);
  return scene;
}

/// A box that pushes sand over the floor, and rubs under another heap.
inline Scene sliding_box() {
  Scene scene = changing_scene("taichi_sand", {0.455, 0.08, 0.4}, {-2, -1, 0});
  add_box(scene, "taichi_snow", {0.36, 0.13, 0.4}, 0.04);
  scene.sources[1].particles_per_cell = 4;
  scene.sources[1].velocity = {0, -1, 0.3};
  Motion motion;
  motion.velocity = {6, 0, 0};
  scene.obstacles.push_back(moving_box({0.37, 0.075, 0.4}, {0.1, 0.06, 0.1}, motion, 0.4));
  return scene;
}

/// A plate by keyframes, thinner than a cell, that tips jelly towards a ball.
inline Scene tilting_tray() {
  Scene scene = changing_scene("taichi_jelly", {0.4, 0.151, 0.4}, {0, -6, 0});
  Motion motion;
  motion.kind = MotionKind::keyframes;
  motion.axis = {0, 0, 1};
  motion.keyframes = {{0.002, {0, 0.003, 0}, -5}, {0.01, {0.01, 0.003, 0}, -20}};
  scene.obstacles.push_back(moving_box({0.4, 0.118, 0.4}, {0.14, 0.012, 0.14}, motion, 0.3));
  scene.obstacles.back().contact = Contact::stick;
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.04;
  ball.position = {0.476, 0.13, 0.4};
  scene.obstacles.push_back(ball);
  return scene;
}

/// A jet into a sink that also takes jelly from the floor.
inline Scene emitter_and_sink() {
  Scene scene = changing_scene("taichi_jelly", {0.45, 0.09, 0.4}, {-3, -1, 0});
  scene.materials["taichi_water"] = preset("taichi_water");
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.05, 0.02, 0.05};
  emitter.position = {0.4, 0.2, 0.4};
  emitter.material = "taichi_water";
  emitter.velocity = {0, -10, 0};
  emitter.particles_per_cell = 4;
  emitter.end_time = 0.008;
  scene.emitters.push_back(emitter);
  Sink sink;
  sink.size = {0.1, 0.1, 0.1};
  sink.position = {0.39, 0.12, 0.4};
  scene.sinks.push_back(sink);
  return scene;
}

/// Two bodies that leave through an open wall and an open lid, one of them around a post that sinks into the floor.
inline Scene open_walls() {
  Scene scene = changing_scene("taichi_snow", {0.9, 0.1, 0.5}, {8, -1, 0});
  add_box(scene, "taichi_water", {0.86, 0.9, 0.5}, 0.05);
  scene.sources[1].velocity = {5, 9, 0};
  scene.sources[1].particles_per_cell = 4;
  scene.domain.faces.x_high = WallConfig{.kind = Wall::open, .friction = {}};
  scene.domain.faces.y_high = WallConfig{.kind = Wall::open, .friction = {}};
  Motion motion;
  motion.velocity = {0, -2, 0};
  scene.obstacles.push_back(moving_box({0.945, 0.085, 0.5}, {0.03, 0.08, 0.03}, motion, 0.2));
  return scene;
}

/// Jelly whose ends are held and twisted, until one is let go between two substeps; PIC.
inline Scene gripped_jelly() {
  Scene scene = changing_scene("taichi_jelly", {0.4, 0.3, 0.4}, {0, -1, 0});
  scene.sources[0].size = {0.16, 0.06, 0.06};
  scene.transfer.scheme = TransferScheme::pic;
  KinematicRegion end;
  end.shape = RegionShape::half_space;
  end.position = {0.35, 0.3, 0.4};
  end.normal = {1, 0, 0};
  end.motion = Motion{};
  scene.kinematic_regions.push_back(end);
  end.position[0] = 0.45;
  end.normal = {-1, 0, 0};
  end.motion.velocity = {3, 1, 0};
  end.motion.spin = 60;
  end.motion.axis = {1, 0, 0};
  end.release_time = 0.0052;
  scene.kinematic_regions.push_back(end);
  return scene;
}

/// A led block of snow that moves through falling sand; damped RPIC.
inline Scene led_blocks() {
  Scene scene = changing_scene("taichi_sand", {0.4, 0.165, 0.4}, {0, -4, 0});
  scene.transfer.scheme = TransferScheme::rpic;
  scene.transfer.damping = 40;
  add_box(scene, "taichi_snow", {0.4, 0.1, 0.4}, 0.06);
  scene.sources[1].particles_per_cell = 4;
  scene.sources[1].motion = Motion{};
  scene.sources[1].motion->velocity = {2, 1, 0};
  scene.sources[1].motion->end_time = 0.02;
  return scene;
}

inline std::vector<std::pair<std::string, Scene>> changing_scenes() {
  return {{"turning paddle", turning_paddle()}, {"sliding box", sliding_box()},
          {"tilting tray", tilting_tray()},     {"emitter and sink", emitter_and_sink()},
          {"open walls", open_walls()},         {"gripped jelly", gripped_jelly()},
          {"led blocks", led_blocks()}};
}

}  // namespace graupel::mpm
