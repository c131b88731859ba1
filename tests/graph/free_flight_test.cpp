// What flies keeps its momentum, what touches something is left alone.
#include "graph/free_flight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "core/buffer.h"
#include "core/random.h"
#include "tests/gpu_only.h"

namespace graupel::graph {
namespace {

constexpr int32_t water = 5, sand = 6;

Scene box_scene(bool with_obstacle = false) {
  Scene scene;
  scene.domain.dx = 1.0 / 64;
  scene.domain.wall_cells = 2;
  scene.materials["water"].model = MaterialModel::water;
  scene.materials["sand"].model = MaterialModel::sand;
  scene.materials["sand"].density = 1600;
  if (with_obstacle) {
    Obstacle sphere;
    sphere.shape = Shape::sphere;
    sphere.radius = 0.1;
    sphere.position = {0.5, 0.3, 0.5};
    scene.obstacles.push_back(sphere);
  }
  return scene;
}

struct Frame {
  std::vector<Vec3f> before, now, next;
  std::vector<int32_t> type;
};

/// A cloud of particles in a ball, each with a velocity around `velocity` and any acceleration.
void add_ball(Frame& frame, const Scene& scene, const Vec3f& centre, int n, const Vec3f& velocity, int32_t type,
              uint64_t seed) {
  const Random random(seed, RandomPurpose::test);
  for (int i = 0; i < n; ++i) {
    Vec3f x = centre, v = velocity, a{};
    for (int d = 0; d < 3; ++d) {
      x[d] += static_cast<float>(random.uniform(3 * i, d, -0.05, 0.05));
      v[d] += static_cast<float>(random.uniform(3 * i + 1, d, -0.002, 0.002));
      a[d] = static_cast<float>(random.uniform(3 * i + 2, d, -0.003, 0.003) +
                                scene.gravity[d] * scene.frame_time * scene.frame_time);
    }
    frame.before.push_back(x - v);
    frame.now.push_back(x);
    frame.next.push_back(x + v + a);
    frame.type.push_back(type);
  }
}

std::vector<Vec3f> corrected(const Scene& scene, const Frame& frame, std::vector<bool>* flying = nullptr) {
  const Surroundings surroundings(scene);
  FreeFlight flight(Device::cpu, scene, surroundings, frame.type);
  std::vector<Vec3f> next = frame.next;
  flight.find_groups(frame.before.data(), frame.now.data());
  flight.correct(frame.before.data(), frame.now.data(), next.data());
  if (flying) *flying = flight.flying();
  return next;
}

Vec3d acceleration(const Frame& frame, const std::vector<Vec3f>& next, std::size_t i) {
  return next[i].cast<double>() - frame.now[i].cast<double>() * 2.0 + frame.before[i].cast<double>();
}

struct Momenta {
  Vec3d linear = Vec3d::zero(), angular = Vec3d::zero();  ///< sum m (a - g), sum m x cross (a - g)
};
Momenta momenta(const Scene& scene, const Frame& frame, const std::vector<Vec3f>& next, std::size_t begin,
                std::size_t end) {
  Momenta sum;
  for (std::size_t i = begin; i < end; ++i) {
    const double mass = frame.type[i] == sand ? 1.6 : 1;
    const Vec3d a = (acceleration(frame, next, i) - scene.gravity * (scene.frame_time * scene.frame_time)) * mass;
    sum.linear += a;
    sum.angular += cross(frame.now[i].cast<double>(), a);
  }
  return sum;
}

/// Of sums of 100 rounded accelerations.
constexpr double rounding = 2e-5;

TEST(FreeFlight, GroupKeepsItsMomenta) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {0.5f, 0.5f, 0.5f}, 60, {0.01f, -0.02f, 0}, water, 1);
  add_ball(frame, scene, {0.55f, 0.5f, 0.5f}, 40, {0.01f, -0.02f, 0}, sand, 2);
  const Momenta before = momenta(scene, frame, frame.next, 0, 100);
  EXPECT_GT(norm(before.linear), 1e-3);
  EXPECT_GT(norm(before.angular), 1e-3);
  const Momenta after = momenta(scene, frame, corrected(scene, frame), 0, 100);
  EXPECT_LT(norm(after.linear), rounding);
  EXPECT_LT(norm(after.angular), rounding);
}

TEST(FreeFlight, ChangeIsRigid) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {0.5f, 0.5f, 0.5f}, 80, {0, 0, 0}, water, 3);
  const std::vector<Vec3f> next = corrected(scene, frame);
  double largest = 0;
  for (std::size_t i = 1; i < next.size(); ++i) {
    // No two particles come closer or part by the change.
    const Vec3d apart = frame.now[i].cast<double>() - frame.now[0].cast<double>();
    const Vec3d change = acceleration(frame, next, i) - acceleration(frame, frame.next, i) -
                         (acceleration(frame, next, 0) - acceleration(frame, frame.next, 0));
    EXPECT_NEAR(dot(apart, change), 0, 1e-7);
    largest = std::max(largest, norm(change));
  }
  EXPECT_GT(largest, 1e-5);
}

TEST(FreeFlight, SecondCorrectionChangesNothing) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {0.5f, 0.5f, 0.5f}, 50, {0, 0.01f, 0}, water, 4);
  const std::vector<Vec3f> once = corrected(scene, frame);
  Frame again = frame;
  again.next = once;
  const std::vector<Vec3f> twice = corrected(scene, again);
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_LT(norm(twice[i] - once[i]), 1e-6f);
}

TEST(FreeFlight, SingleParticleFallsByGravity) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {0.5f, 0.5f, 0.5f}, 1, {0.01f, 0.01f, 0}, water, 5);
  const Vec3d a = acceleration(frame, corrected(scene, frame), 0);
  const Vec3d gravity = scene.gravity * (scene.frame_time * scene.frame_time);
  EXPECT_LT(norm(a - gravity), 1e-6);
}

TEST(FreeFlight, WhatTouchesIsLeftAlone) {
  const Scene scene = box_scene(true);
  Frame frame;
  add_ball(frame, scene, {0.5f, 0.08f, 0.8f}, 30, {0, 0, 0}, water, 6);      // the floor
  add_ball(frame, scene, {0.5f, 0.44f, 0.5f}, 30, {0, 0, 0}, water, 7);      // the sphere
  add_ball(frame, scene, {0.2f, 0.5f, 0.2f}, 30, {0, -0.41f, 0}, water, 8);  // reaches the floor within the frame
  add_ball(frame, scene, {0.8f, 0.5f, 0.8f}, 30, {0, 0, 0}, water, 9);       // nothing
  std::vector<bool> flying;
  const std::vector<Vec3f> next = corrected(scene, frame, &flying);
  for (std::size_t i = 0; i < 90; ++i) {
    EXPECT_FALSE(flying[i]) << i;
    EXPECT_EQ(std::memcmp(&next[i], &frame.next[i], sizeof(Vec3f)), 0) << i;
  }
  for (std::size_t i = 90; i < 120; ++i) EXPECT_TRUE(flying[i]) << i;
  EXPECT_LT(norm(momenta(scene, frame, next, 90, 120).linear), rounding);
}

TEST(FreeFlight, GroupsFarApartKeepTheirOwn) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {0.3f, 0.5f, 0.5f}, 50, {0, 0, 0}, water, 10);
  add_ball(frame, scene, {0.7f, 0.5f, 0.5f}, 50, {0, 0, 0}, water, 11);
  const std::vector<Vec3f> next = corrected(scene, frame);
  for (const std::size_t begin : {0, 50})
    EXPECT_LT(norm(momenta(scene, frame, next, begin, begin + 50).linear), rounding);
}

TEST(FreeFlight, GroupsThatMeetAreOne) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {0.3f, 0.5f, 0.5f}, 50, {0.15f, 0, 0}, water, 12);
  add_ball(frame, scene, {0.7f, 0.5f, 0.5f}, 50, {-0.15f, 0, 0}, water, 13);
  const std::vector<Vec3f> next = corrected(scene, frame);
  EXPECT_LT(norm(momenta(scene, frame, next, 0, 100).linear), rounding);
  EXPECT_GT(norm(momenta(scene, frame, next, 0, 50).linear), 10 * rounding);  // they may push each other
}

TEST(FreeFlight, OrderAndEarlierFramesDoNotMatter) {
  const Scene scene = box_scene(true);
  Frame frame;
  for (int k = 0; k < 12; ++k)
    add_ball(frame, scene, {0.2f + 0.05f * static_cast<float>(k), 0.7f, 0.3f + 0.15f * static_cast<float>(k % 3)}, 300,
             {0, 0, 0}, k % 2 == 0 ? water : sand, 20 + static_cast<uint64_t>(k));
  const std::size_t n = frame.now.size();
  const std::vector<Vec3f> first = corrected(scene, frame);
  const Surroundings surroundings(scene);
  FreeFlight flight(Device::cpu, scene, surroundings, frame.type);
  for (int repeat = 0; repeat < 2; ++repeat) {
    std::vector<Vec3f> next = frame.next;
    flight.find_groups(frame.before.data(), frame.now.data());
    flight.correct(frame.before.data(), frame.now.data(), next.data());
    EXPECT_EQ(std::memcmp(next.data(), first.data(), n * sizeof(Vec3f)), 0);
  }
  Frame turned = frame;
  for (auto* positions : {&turned.before, &turned.now, &turned.next})
    std::reverse(positions->begin(), positions->end());
  std::reverse(turned.type.begin(), turned.type.end());
  const std::vector<Vec3f> other = corrected(scene, turned);  // other leaders, so rounded otherwise
  for (std::size_t i = 0; i < n; ++i) EXPECT_LT(norm(other[n - 1 - i] - first[i]), 1e-6f);
}

TEST(FreeFlight, ParticlesOutsideTheDomainAreLeftAlone) {
  const Scene scene = box_scene();
  Frame frame;
  add_ball(frame, scene, {5.0f, 0.5f, 0.5f}, 5, {0, 0, 0}, water, 14);
  add_ball(frame, scene, {0.5f, -7.0f, 0.5f}, 5, {0, 0, 0}, water, 15);
  const std::vector<Vec3f> next = corrected(scene, frame);
  EXPECT_EQ(std::memcmp(next.data(), frame.next.data(), next.size() * sizeof(Vec3f)), 0);
}

TEST(FreeFlight, GpuGivesTheSame) {
  GRAUPEL_NEEDS_GPU();
  const Scene scene = box_scene(true);
  Frame frame;
  for (int k = 0; k < 12; ++k)
    add_ball(frame, scene, {0.2f + 0.05f * static_cast<float>(k), 0.7f, 0.3f + 0.15f * static_cast<float>(k % 3)}, 300,
             {0, 0, 0}, k % 2 == 0 ? water : sand, 20 + static_cast<uint64_t>(k));
  const std::vector<Vec3f> expected = corrected(scene, frame);
  const Surroundings surroundings(scene);
  FreeFlight flight(Device::cuda, scene, surroundings, frame.type);
  Buffer<Vec3f> before(Device::cuda, 0), now(Device::cuda, 0), next(Device::cuda, 0);
  before.upload(frame.before);
  now.upload(frame.now);
  next.upload(frame.next);
  flight.find_groups(before.data(), now.data());
  flight.correct(before.data(), now.data(), next.data());
  const std::vector<Vec3f> actual = next.download();
  for (std::size_t i = 0; i < actual.size(); ++i) EXPECT_LT(norm(actual[i] - expected[i]), 1e-6f) << i;
}

}  // namespace
}  // namespace graupel::graph
