// What flies keeps its momentum, what touches something is left alone.
#include "graph/corrections/free_flight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "core/math/random.h"
#include "core/parallel/buffer.h"
#include "graph/corrections/flight_cells.h"
#include "tests/gpu_only.h"
#include "tests/graph/corrections/flight_cases.h"

namespace graupel::graph {
namespace {

struct Result {
  std::vector<Vec3f> next;
  std::vector<int32_t> groups;  ///< -1: touches
};

Result result_of(FreeFlight& flight, const Frame& frame, Device device = Device::cpu) {
  Buffer<Vec3f> before(device, 0), current(device, 0), next(device, 0);
  before.upload(frame.before);
  current.upload(frame.current);
  next.upload(frame.next);
  flight.find_groups(before.data(), current.data());
  flight.correct(before.data(), current.data(), next.data());
  return {next.download(), flight.groups()};
}
Result result_of(const Scene& scene, const Frame& frame, Device device = Device::cpu) {
  const Environment environment(scene);
  FreeFlight flight(device, scene, environment, frame.type);
  return result_of(flight, frame, device);
}
std::vector<Vec3f> corrected(const Scene& scene, const Frame& frame) { return result_of(scene, frame).next; }

bool same_bytes(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3f)) == 0;
}

Vec3d acceleration(const Frame& frame, const std::vector<Vec3f>& next, std::size_t i) {
  return next[i].cast<double>() - frame.current[i].cast<double>() * 2.0 + frame.before[i].cast<double>();
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
    sum.angular += cross(frame.current[i].cast<double>(), a);
  }
  return sum;
}

/// Of sums of 100 rounded accelerations.
constexpr double rounding = 2e-5;

TEST(FreeFlight, GroupKeepsItsMomenta) {
  const Scene scene = box_scene();
  Frame frame;
  add_cloud(frame, scene, {0.5f, 0.5f, 0.5f}, 60, {0.01f, -0.02f, 0}, water, 1);
  add_cloud(frame, scene, {0.55f, 0.5f, 0.5f}, 40, {0.01f, -0.02f, 0}, sand, 2);
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
  add_cloud(frame, scene, {0.5f, 0.5f, 0.5f}, 80, {0, 0, 0}, water, 3);
  const std::vector<Vec3f> next = corrected(scene, frame);
  double largest = 0;
  for (std::size_t i = 1; i < next.size(); ++i) {
    // No two particles come closer or part by the change.
    const Vec3d apart = frame.current[i].cast<double>() - frame.current[0].cast<double>();
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
  add_cloud(frame, scene, {0.5f, 0.5f, 0.5f}, 50, {0, 0.01f, 0}, water, 4);
  const std::vector<Vec3f> once = corrected(scene, frame);
  Frame again = frame;
  again.next = once;
  const std::vector<Vec3f> twice = corrected(scene, again);
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_LT(norm(twice[i] - once[i]), 1e-6f);
}

TEST(FreeFlight, SingleParticleFallsByGravity) {
  const Scene scene = box_scene();
  Frame frame;
  add_cloud(frame, scene, {0.5f, 0.5f, 0.5f}, 1, {0.01f, 0.01f, 0}, water, 5);
  const Vec3d a = acceleration(frame, corrected(scene, frame), 0);
  const Vec3d gravity = scene.gravity * (scene.frame_time * scene.frame_time);
  EXPECT_LT(norm(a - gravity), 1e-6);
}

TEST(FreeFlight, WhatTouchesIsLeftAlone) {
  const Scene scene = box_scene(true);
  Frame frame;
  add_cloud(frame, scene, {0.5f, 0.08f, 0.8f}, 30, {0, 0, 0}, water, 6);      // the floor
  add_cloud(frame, scene, {0.5f, 0.44f, 0.5f}, 30, {0, 0, 0}, water, 7);      // the sphere
  add_cloud(frame, scene, {0.2f, 0.5f, 0.2f}, 30, {0, -0.43f, 0}, water, 8);  // reaches the floor within the frame
  add_cloud(frame, scene, {0.8f, 0.5f, 0.8f}, 30, {0, 0, 0}, water, 9);       // nothing
  const auto [next, groups] = result_of(scene, frame);
  for (std::size_t i = 0; i < 90; ++i) {
    EXPECT_EQ(groups[i], -1) << i;
    EXPECT_EQ(std::memcmp(&next[i], &frame.next[i], sizeof(Vec3f)), 0) << i;
  }
  for (std::size_t i = 90; i < 120; ++i) EXPECT_GE(groups[i], 0) << i;
  EXPECT_LT(norm(momenta(scene, frame, next, 90, 120).linear), rounding);
}

TEST(FreeFlight, GroupsThreeCellsApartKeepTheirOwn) {
  const Scene scene = box_scene();
  for (const float apart : {0.05f, 0.3f}) {
    Frame frame;  // they fall side by side and above each other
    add_cloud(frame, scene, {0.3f, 0.5f, 0.5f}, 50, {0, -0.05f, 0}, water, 10);
    add_cloud(frame, scene, {0.36f + apart, 0.5f, 0.5f}, 50, {0, -0.05f, 0}, sand, 11);
    add_cloud(frame, scene, {0.3f, 0.56f + apart, 0.5f}, 50, {0, -0.05f, 0}, water, 16);
    const std::vector<Vec3f> next = corrected(scene, frame);
    for (const std::size_t begin : {0, 50, 100}) {
      const Momenta kept = momenta(scene, frame, next, begin, begin + 50);
      EXPECT_LT(norm(kept.linear), rounding);
      EXPECT_LT(norm(kept.angular), rounding);
    }
  }
}

TEST(FreeFlight, GroupsThatMeetAreOne) {
  const Scene scene = box_scene();
  for (const auto& [x, way] : {std::pair{0.7f, 0.17f}, std::pair{0.7f, -1.0f}, std::pair{0.38f, 0.0f}}) {
    Frame frame;
    const float own = way < 0 ? 0.36f : way;  // the second catches up with what flies before it
    add_cloud(frame, scene, {0.3f, 0.5f, 0.5f}, 50, {own, 0, 0}, water, 12);
    add_cloud(frame, scene, {x, 0.5f, 0.5f}, 50, {way < 0 ? 0.03f : -way, 0, 0}, water, 13);
    const std::vector<Vec3f> next = corrected(scene, frame);
    EXPECT_LT(norm(momenta(scene, frame, next, 0, 100).linear), rounding);
    EXPECT_GT(norm(momenta(scene, frame, next, 0, 50).linear), 10 * rounding);  // they may push each other
  }
}

/// Groups of what is less than `apart` [m] away along each axis, now or after a frame of flight.
std::vector<int32_t> groups_by_pairs(const Scene& scene, const Frame& frame, float apart) {
  const Vec3f gravity = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
  const std::size_t n = frame.current.size();
  const auto near = [&](std::size_t i, std::size_t j) {
    bool now = true, then = true;
    for (int d = 0; d < 3; ++d) {
      const auto after = [&](std::size_t k) { return 2 * frame.current[k][d] - frame.before[k][d] + gravity[d]; };
      now = now && std::abs(frame.current[i][d] - frame.current[j][d]) < apart;
      then = then && std::abs(after(i) - after(j)) < apart;
    }
    return now || then;
  };
  std::vector<int32_t> group(n, -1);
  for (std::size_t i = 0; i < n; ++i) {
    if (group[i] >= 0) continue;
    std::vector<std::size_t> open = {i};
    group[i] = static_cast<int32_t>(i);
    while (!open.empty()) {
      const std::size_t k = open.back();
      open.pop_back();
      for (std::size_t j = 0; j < n; ++j)
        if (group[j] < 0 && near(k, j)) {
          group[j] = group[i];
          open.push_back(j);
        }
    }
  }
  return group;
}

/// Whether each group of `parts` lies within one of `wholes`.
bool lie_within(const std::vector<int32_t>& parts, const std::vector<int32_t>& wholes) {
  std::map<int32_t, int32_t> whole;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (whole.emplace(parts[i], wholes[i]).first->second != wholes[i]) return false;
  return true;
}

TEST(FreeFlight, GroupsAreThoseOfDistances) {
  const Scene scene = box_scene();
  const Random random(30, RandomPurpose::test);
  std::size_t least = 1000, most = 0;
  for (int k = 0; k < 20; ++k) {  // from single particles to one group
    Frame frame;
    const auto half = 0.05 + 0.015 * k;
    for (int i = 0; i < 400; ++i) {
      Vec3f x, v;
      for (int d = 0; d < 3; ++d) {
        x[d] = static_cast<float>(random.uniform(1000 * k + i, d, 0.5 - half, 0.5 + half));
        v[d] = static_cast<float>(random.uniform(100000 + 1000 * k + i, d, -0.005, 0.005));
      }
      frame.before.push_back(x - v);
      frame.current.push_back(x);
    }
    frame.next = frame.current;
    frame.type.assign(400, water);
    const std::vector<int32_t> groups = result_of(scene, frame).groups;
    EXPECT_TRUE(lie_within(groups_by_pairs(scene, frame, 1.999f * cell), groups)) << k;
    EXPECT_TRUE(lie_within(groups, groups_by_pairs(scene, frame, 2.501f * cell))) << k;
    const std::size_t count = std::set(groups.begin(), groups.end()).size();
    least = std::min(least, count);
    most = std::max(most, count);
  }
  EXPECT_EQ(least, 1u);
  EXPECT_GT(most, 150u);
}

TEST(FreeFlight, FineCellsAreNearUpToFourApart) {
  using flight::any_near;
  for (int k = 0; k < 27; ++k) {
    const Vec3i step = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
    for (int a = 0; a < 64; ++a)
      for (int b = 0; b < 64; ++b) {
        bool near = true;
        for (int d = 0, scale = 1; d < 3; ++d, scale *= 4)
          near = near && std::abs(4 * step[d] + b / scale % 4 - a / scale % 4) <= 4;
        ASSERT_EQ(any_near(uint64_t{1} << a, uint64_t{1} << b, step), near) << k << " " << a << " " << b;
      }
  }
}

TEST(FreeFlight, OrderAndEarlierFramesDoNotMatter) {
  const Scene scene = box_scene(true);
  const Frame frame = crowd(scene);
  const Result first = result_of(scene, frame);
  EXPECT_GT(std::set(first.groups.begin(), first.groups.end()).size(), 50u);
  EXPECT_GT(std::count(first.groups.begin(), first.groups.end(), -1), 400);
  const Environment environment(scene);
  FreeFlight flight(Device::cpu, scene, environment, frame.type);
  Frame empty = frame;  // all in one place: as little as can be
  std::fill(empty.current.begin(), empty.current.end(), Vec3f::filled(0.7f));
  for (int repeat = 0; repeat < 3; ++repeat) {
    const Result again = result_of(flight, repeat == 1 ? empty : frame);
    if (repeat == 1) continue;
    EXPECT_TRUE(same_bytes(again.next, first.next));
    EXPECT_TRUE(same_groups(again.groups, first.groups));
  }
  Frame turned = frame;
  for (auto* positions : {&turned.before, &turned.current, &turned.next})
    std::reverse(positions->begin(), positions->end());
  std::reverse(turned.type.begin(), turned.type.end());
  Result other = result_of(scene, turned);
  std::reverse(other.next.begin(), other.next.end());
  std::reverse(other.groups.begin(), other.groups.end());
  EXPECT_TRUE(same_bytes(other.next, first.next));
  EXPECT_TRUE(same_groups(other.groups, first.groups));
}

TEST(FreeFlight, StartsAsANewOneAfterAnotherScene) {
  Scene other = box_scene(false);
  other.domain.dx *= 1.5;
  other.gravity = {0, -3, 1};
  for (const Device device : {Device::cpu, Device::cuda}) {
    if (device == Device::cuda && !cuda_available()) continue;
    const Scene scene = box_scene(true);
    const Environment first(scene), second(other);
    const Frame frame = crowd(scene), larger = snake(other, 5000);
    FreeFlight flight(device, scene, first, frame.type);
    result_of(flight, frame, device);
    const auto expect_as_new = [&](const Scene& next, const Environment& environment, const Frame& of_next) {
      const Result expected = result_of(next, of_next, device);
      EXPECT_FALSE(same_bytes(expected.next, of_next.next));
      flight.start(next, environment, of_next.type);
      const Result actual = result_of(flight, of_next, device);
      EXPECT_TRUE(same_bytes(actual.next, expected.next));
      EXPECT_TRUE(same_groups(actual.groups, expected.groups));
    };
    expect_as_new(other, second, larger);
    expect_as_new(scene, first, frame);
  }
}

TEST(FreeFlight, LongSnakeIsOneGroup) {
  const Scene scene = box_scene();
  Frame frame = snake(scene, 50000);
  const auto groups_of = [&] {
    const std::vector<int32_t> groups = result_of(scene, frame).groups;
    EXPECT_EQ(std::count(groups.begin(), groups.end(), -1), 0);
    return std::set(groups.begin(), groups.end()).size();
  };
  EXPECT_EQ(groups_of(), 1u);
  for (auto* positions : {&frame.before, &frame.current, &frame.next})
    positions->erase(positions->begin() + 25000, positions->begin() + 25015);
  frame.type.resize(frame.current.size());
  EXPECT_EQ(groups_of(), 2u);
}

TEST(FreeFlight, WhatIsOutsideTheDomainOrNowhereIsLeftAlone) {
  const Scene scene = box_scene();
  Frame frame;
  add_cloud(frame, scene, {5.0f, 0.5f, 0.5f}, 5, {0, 0, 0}, water, 14);
  add_cloud(frame, scene, {0.5f, -7.0f, 0.5f}, 5, {0, 0, 0}, water, 15);
  add_cloud(frame, scene, {1e30f, -1e30f, 0.5f}, 5, {0, 0, 0}, water, 15);
  add_cloud(frame, scene, {0.5f, 0.5f, 0.5f}, 1, {0, 0, 0}, water, 17);
  add_cloud(frame, scene, {0.8f, 0.5f, 0.5f}, 1, {0, 0, 0}, water, 18);
  add_cloud(frame, scene, {0.2f, 0.5f, 0.2f}, 40, {0, 0, 0}, water, 19);
  frame.current[15] = Vec3f::filled(std::numeric_limits<float>::quiet_NaN());
  frame.before[16][2] = std::numeric_limits<float>::infinity();
  const std::vector<Vec3f> next = corrected(scene, frame);
  EXPECT_EQ(std::memcmp(next.data(), frame.next.data(), 17 * sizeof(Vec3f)), 0);
  EXPECT_LT(norm(momenta(scene, frame, next, 17, 57).linear), rounding);
}

TEST(FreeFlight, NoParticlesAreNoGroups) {
  for (const Device device : {Device::cpu, Device::cuda}) {
    if (device == Device::cuda && !cuda_available()) continue;
    EXPECT_TRUE(result_of(box_scene(), {}, device).groups.empty());
  }
}

TEST(FreeFlight, GpuGivesTheSame) {
  GRAUPEL_NEEDS_GPU();
  for (const bool with_obstacle : {true, false}) {
    const Scene scene = box_scene(with_obstacle);
    const Environment environment(scene);
    for (const Frame& frame : {crowd(scene), snake(scene, 50000)}) {
      const Result expected = result_of(scene, frame);
      FreeFlight flight(Device::cuda, scene, environment, frame.type);
      for (int repeat = 0; repeat < 3; ++repeat) {
        const Result actual = result_of(flight, frame, Device::cuda);
        EXPECT_TRUE(same_groups(actual.groups, expected.groups));
        EXPECT_TRUE(same_bytes(actual.next, expected.next));
      }
    }
  }
}

}  // namespace
}  // namespace graupel::graph
