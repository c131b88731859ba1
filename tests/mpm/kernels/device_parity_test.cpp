// The same run on the CPU and on a GPU: sums differ in their order alone, so the drift stays at rounding level; over
// whole runs, where rounding grows, the material as a whole does the same.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/system/error.h"
#include "mpm/simulation.h"
#include "tests/gpu_only.h"
#include "tests/mpm/changing_scenes.h"

namespace graupel::mpm {
namespace {

void expect_close(const ParticleFrame& a, const ParticleFrame& b, const std::string& what) {
  ASSERT_EQ(a.position.size(), b.position.size());
  EXPECT_TRUE(a.active == b.active) << what;
  float worst_position = 0, worst_velocity = 0;
  for (std::size_t i = 0; i < a.position.size(); ++i) {
    worst_position = std::max(worst_position, norm(a.position[i] - b.position[i]));
    worst_velocity = std::max(worst_velocity, norm(a.velocity[i] - b.velocity[i]));
  }
  EXPECT_LT(worst_position, 1e-5f) << what;
  EXPECT_LT(worst_velocity, 2e-2f) << what;
}

/// Part of the particles that are further apart than expect_close() allows: those that one run pushes out of a moving
/// obstacle a step before the other.
double share_apart(const ParticleFrame& a, const ParticleFrame& b) {
  std::size_t apart = 0;
  for (std::size_t i = 0; i < a.position.size(); ++i)
    apart += norm(a.position[i] - b.position[i]) > 1e-5f || norm(a.velocity[i] - b.velocity[i]) > 2e-2f;
  return static_cast<double>(apart) / static_cast<double>(a.position.size());
}

/// A frame on the CPU and on the GPU.
void expect_parity(const Scene& scene, Kernels kernels, const std::string& what) {
  const auto cpu = Simulation::create(scene, {}),
             gpu = Simulation::create(scene, {.device = Device::cuda, .kernels = kernels});
  cpu->advance_frame();
  gpu->advance_frame();
  expect_close(cpu->frame(), gpu->frame(), what);
  EXPECT_EQ(cpu->statistics().substeps, gpu->statistics().substeps) << what;
}

TEST(DeviceParity, TwentySubstepsOnTheGpuEqualTheCpu) {
  GRAUPEL_NEEDS_GPU();
  for (const Kernels kernels : {Kernels::portable, Kernels::tuned})
    expect_parity(four_materials(), kernels, kernels == Kernels::tuned ? "tuned" : "portable");
}

/// Fixed steps of so few particles run in the kernel for small scenes; adaptive ones by blocks.
TEST(DeviceParity, AdaptiveStepsOnTheGpuEqualTheCpu) {
  GRAUPEL_NEEDS_GPU();
  Scene scene = four_materials();
  scene.time_step.policy = StepPolicy::adaptive;
  expect_parity(scene, Kernels::tuned, "adaptive");
}

TEST(DeviceParity, EveryModelMovesTheSameOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  Scene scene = every_model();
  set_steps(scene, 20, 1e-4);
  for (const Kernels kernels : {Kernels::portable, Kernels::tuned})
    expect_parity(scene, kernels, kernels == Kernels::tuned ? "tuned" : "portable");
}

TEST(DeviceParity, EveryContactAndShapeMovesTheSameOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  for (const Contact contact : {Contact::stick, Contact::slip, Contact::separate})
    for (const Shape shape : {Shape::box, Shape::sphere, Shape::cone, Shape::pyramid, Shape::cylinder, Shape::plane}) {
      Scene scene = scene_with("taichi_sand", {0.5, 0.27, 0.5}, 0.06);
      Obstacle obstacle;
      obstacle.shape = shape;
      obstacle.size = {0.2, 0.1, 0.2};
      obstacle.radius = 0.1;
      obstacle.height = 0.1;
      obstacle.position = {0.5, shape == Shape::sphere ? 0.13 : shape == Shape::plane ? 0.22 : 0.17, 0.5};
      obstacle.contact = contact;
      obstacle.friction = 0.3;
      scene.obstacles.push_back(obstacle);
      scene.domain.walls = contact;
      scene.sources[0].velocity = {0.5, -2, 0.2};
      set_steps(scene, 30, 2e-4);
      expect_parity(scene, Kernels::tuned, word_of(contact) + std::string(" ") + word_of(shape));
    }
}

/// What not all tuned kernels know: for most Simulation::create takes the portable ones.
std::vector<std::pair<std::string, Scene>> scenes_beyond_tuned_kernels() {
  std::vector<std::pair<std::string, Scene>> scenes;
  const auto add = [&](const std::string& name) -> Scene& {
    scenes.emplace_back(name, scene_with("taichi_jelly", {0.5, 0.2, 0.5}));
    scenes.back().second.sources[0].velocity = {1, -2, 0};
    set_steps(scenes.back().second, 20, 3e-4);
    scenes.back().second.frames = 2;
    return scenes.back().second;
  };
  Scene& carried = add("moving and turning obstacle");
  Obstacle table;
  table.size = {0.3, 0.05, 0.3};
  table.position = {0.5, 0.13, 0.5};
  table.friction = 0.4;
  Motion motion;
  motion.velocity = {0.5, 0.3, 0};
  motion.spin = 3;
  motion.axis = {0, 1, 0};
  table.motion = motion;
  carried.obstacles.push_back(table);
  Scene& kinematic = add("led particles");
  KinematicRegion region;
  region.shape = RegionShape::half_space;
  region.position = {0.48, 0.2, 0.5};
  region.normal = {1, 0, 0};
  region.motion = motion;
  kinematic.kinematic_regions.push_back(region);
  Scene& emitted = add("emitter and sink");
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.06, 0.02, 0.06};
  emitter.position = {0.3, 0.5, 0.5};
  emitter.material = "taichi_jelly";
  emitter.velocity = {0, -3, 0};
  emitter.end_time = 0.1;
  emitted.emitters.push_back(emitter);
  Scene& through = add("open and periodic walls");
  through.sources[0].position = {0.9, 0.2, 0.5};
  through.sources[0].velocity = {8, 0, 0};
  through.domain.faces.x_high = WallConfig{.kind = Wall::periodic, .friction = {}};
  through.domain.faces.x_low = through.domain.faces.x_high;
  through.domain.faces.y_high = WallConfig{.kind = Wall::open, .friction = {}};
  Scene& pushed = add("loads and gravity that changes");
  for (const double start : {0.0, 0.7}) {
    TimedLoad load;
    load.start = start * pushed.frame_time;
    load.duration = 0.6 * pushed.frame_time;
    load.place = pushed.sources[0].position;
    load.radius = 0.05;
    load.force = {3, 1, 0};
    pushed.loads.push_back(load);
  }
  pushed.gravity_keyframes = {{1.5 * pushed.frame_time, {1, 5, 0}}};
  add("PIC").transfer.scheme = TransferScheme::pic;
  add("RPIC").transfer.scheme = TransferScheme::rpic;
  add("damped APIC").transfer.damping = 20;
  for (const int dimensions : {2, 3})
    for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
      if (dimensions == 3 && spline == Spline::quadratic) continue;
      Scene scene = four_materials();
      if (dimensions == 2) {
        scene.obstacles[0].position[2] = 0.5;
        scene.sources[3].position = {0.62, 0.25, 0.5};
        scene = in_the_plane(scene);
      }
      scene.transfer.spline = spline;
      scenes.emplace_back(std::to_string(dimensions) + "-D " + word_of(spline), scene);
    }
  return scenes;
}

TEST(DeviceParity, WhatTheTunedKernelsDoNotKnowMovesTheSameOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  for (const auto& [name, scene] : scenes_beyond_tuned_kernels()) expect_parity(scene, Kernels::tuned, name);
}

/// Obstacles that move, particles that come and go: in the kernel for small scenes, by blocks none of it.
TEST(DeviceParity, SmallScenesThatChangeMoveTheSameWithTunedAndPortableKernels) {
  GRAUPEL_NEEDS_GPU();
  for (const auto& [name, scene] : changing_scenes()) {
    const auto tuned = Simulation::create(scene, {.device = Device::cuda}),
               portable = Simulation::create(scene, {.device = Device::cuda, .kernels = Kernels::portable}),
               cpu = Simulation::create(scene, {}),
               in_double = Simulation::create(scene, {.precision = Precision::f64});
    for (int f = 0; f < 3; ++f) {
      for (Simulation* run : {tuned.get(), portable.get(), cpu.get(), in_double.get()}) run->advance_frame();
      expect_close(portable->frame(), tuned->frame(), name);
      // As many particles as rounding alone pushes at another step or to another side, of which a fiftieth may be.
      const double by_rounding = share_apart(cpu->frame(), in_double->frame());
      EXPECT_LE(share_apart(cpu->frame(), tuned->frame()), std::clamp(by_rounding, 0.002, 0.02)) << name << ", CPU";
    }
    EXPECT_EQ(tuned->statistics().active_blocks, 0) << name << ": not in the kernel for small scenes";
    EXPECT_GT(portable->statistics().active_blocks, 0) << name;
    const RunStatistics a = tuned->statistics(), b = portable->statistics();
    EXPECT_EQ(a.substeps, b.substeps) << name;
    EXPECT_EQ(a.born, b.born) << name;
    EXPECT_EQ(a.removed, b.removed) << name;
    const auto pushed = static_cast<double>(b.pushed_out);
    EXPECT_NEAR(static_cast<double>(a.pushed_out), pushed, 0.02 * pushed + 3) << name;
    EXPECT_NEAR(tuned->diagnostics().mass, portable->diagnostics().mass, 1e-9) << name;
  }
}

TEST(DeviceParity, TunedKernelsGiveTheSameBytesInEveryRun) {
  GRAUPEL_NEEDS_GPU();
  for (const StepPolicy policy : {StepPolicy::fixed, StepPolicy::adaptive}) {
    Scene scene = scene_with("taichi_sand", {0.4, 0.11, 0.4});
    scene.time_step.policy = policy;
    std::vector<Vec3f> first;
    for (int run = 0; run < 3; ++run) {
      const auto gpu = Simulation::create(scene, {.device = Device::cuda});
      for (int f = 0; f < 5; ++f) gpu->advance_frame();
      const ParticleFrame frame = gpu->frame();
      if (run == 0) first = frame.position;
      EXPECT_TRUE(first == frame.position);
    }
  }
}

struct Course {
  Vec3d centre;
  double kinetic = 0, front = 0;  ///< [J], [m]: 99 % of the particles lie below it along x
};

Course course_of(const Simulation& run) {
  Course c{{0, 0, 0}};
  const ParticleFrame frame = run.frame();
  std::vector<double> x;
  for (const Vec3f& p : frame.position) {
    c.centre = c.centre + p.cast<double>() * (1 / static_cast<double>(frame.position.size()));
    x.push_back(static_cast<double>(p[0]));
  }
  std::nth_element(x.begin(), x.begin() + static_cast<long>(x.size() * 99 / 100), x.end());
  c.front = x[x.size() * 99 / 100];
  c.kinetic = run.diagnostics().kinetic_energy;
  return c;
}

/// A column that collapses over a step, a second long: rounding has grown long before, the course has not.
TEST(DeviceParity, WholeRunsAgreeInCentreEnergyAndFront) {
  GRAUPEL_NEEDS_GPU();
  for (const char* material : {"taichi_water", "taichi_sand", "taichi_snow", "taichi_jelly"}) {
    Scene scene = scene_with(material, {0.3, 0.17, 0.5});
    scene.sources[0].size = {0.16, 0.24, 0.12};
    Obstacle step;
    step.size = {0.1, 0.08, 0.4};
    step.position = {0.55, 0.08, 0.5};
    scene.obstacles.push_back(step);
    for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
      const auto cpu = Simulation::create(scene, {}),
                 gpu = Simulation::create(scene, {.device = Device::cuda, .kernels = kernels});
      double highest = 0;
      for (int f = 0; f < 60; ++f) {
        cpu->advance_frame();
        gpu->advance_frame();
        const Course a = course_of(*cpu), b = course_of(*gpu);
        highest = std::max(highest, a.kinetic);
        ASSERT_LT(norm(a.centre - b.centre), 0.1 * scene.domain.dx) << material << " frame " << f;
        ASSERT_NEAR(a.front, b.front, scene.domain.dx) << material << " frame " << f;
        ASSERT_NEAR(a.kinetic, b.kinetic, 0.05 * highest) << material << " frame " << f;
      }
    }
  }
}

}  // namespace
}  // namespace graupel::mpm
