// Scenes whose environment or particles change, for rollouts on the CPU and on a GPU.
#pragma once

#include <limits>

#include "graph/learned_simulator.h"
#include "tests/graph/random_input.h"

namespace graupel::graph {

/// `spin` [rad/s] is about z.
inline Motion motion_of(const Vec3d& velocity, double spin = 0) {
  Motion motion;
  motion.velocity = velocity;
  motion.spin = spin;
  motion.axis = {0, 0, 1};
  return motion;
}

/// A scene with the particles that it starts with and those that appear later.
struct ChangingCase {
  Scene scene;
  std::vector<int32_t> type;
  std::vector<Vec3f> position, velocity;
  ParticleSchedule schedule;

  void add(const Vec3f& x, const Vec3f& v, double birth = 0, int32_t script = -1) {
    type.push_back(5);
    position.push_back(x);
    velocity.push_back(v);
    schedule.birth_time.push_back(birth);
    schedule.birth_velocity.push_back(v);
    schedule.script.push_back(script);
  }
  std::vector<std::vector<Vec3f>> history(int frames) const {
    return start_history(position, velocity, scene.gravity, scene.frame_time, frames);
  }
};

/// A cube of particles of `edge` [m] about `center`.
inline std::vector<Vec3f> cube(const Vec3f& center, float edge, int along) {
  std::vector<Vec3f> position;
  for (int i = 0; i < along * along * along; ++i)
    position.push_back(center +
                       Vec3f{static_cast<float>(i % along), static_cast<float>(i / along % along),
                             static_cast<float>(i / along / along)} *
                           (edge / static_cast<float>(along - 1)) -
                       Vec3f::filled(edge / 2));
  return position;
}

/// A body that crosses the periodic walls of x.
inline ChangingCase body_across_a_periodic_wall() {
  ChangingCase c;
  c.scene.domain.size = {1 + 6 * c.scene.domain.dx, 1, 1};  // a period of 1 m
  c.scene.domain.faces.x_low = c.scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  for (const Vec3f& x : cube({0.85f, 0.7f, 0.5f}, 0.12f, 5)) c.add(x, {3.0f, 0.5f, 0.2f});
  return c;
}

/// A fast thin plate that sweeps a cloud at rest along x, without gravity.
inline ChangingCase moving_paddle() {
  ChangingCase c;
  c.scene.gravity = Vec3d::zero();
  Obstacle paddle;
  paddle.size = {0.04, 0.5, 0.5};
  paddle.position = {0.25, 0.5, 0.5};
  paddle.motion = motion_of({3, 0, 0});  // more than its thickness a frame
  c.scene.obstacles.push_back(paddle);
  for (const Vec3f& x : cube({0.5f, 0.5f, 0.5f}, 0.2f, 6)) c.add(x, Vec3f::zero());
  return c;
}

/// Particles that appear one after the other over a sink on the floor.
inline ChangingCase emitter_over_a_sink() {
  ChangingCase c;
  c.scene.emitters.emplace_back();
  Sink sink;
  sink.size = {0.5, 0.02, 0.5};  // less than a frame's way
  sink.position = {0.5, 0.3, 0.5};
  c.scene.sinks.push_back(sink);
  for (int i = 0; i < 20; ++i)
    c.add({0.4f + 0.01f * static_cast<float>(i), 0.6f, 0.5f}, {0, -2, 0}, i == 0 ? 0 : 0.013 * i);
  return c;
}

/// Particles of which the first eight turn about an axis, until they are let go.
inline ChangingCase scripted_particles(double release_time = std::numeric_limits<double>::infinity()) {
  ChangingCase c;
  ParticleScript script{motion_of({0.2, 0, 0}, 3), {0.5, 0.5, 0.5}, release_time};
  c.schedule.scripts.push_back(script);
  const std::vector<Vec3f> led = cube({0.5f, 0.5f, 0.5f}, 0.05f, 2), free = cube({0.6f, 0.65f, 0.5f}, 0.05f, 2);
  for (const Vec3f& x : led) c.add(x, Vec3f::zero(), 0, 0);
  for (const Vec3f& x : free) c.add(x, Vec3f::zero());
  return c;
}

}  // namespace graupel::graph
