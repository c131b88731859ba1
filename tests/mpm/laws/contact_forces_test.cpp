// Forces of the matter on obstacles and walls: balances of momentum to round-off, weights, friction, a jet, and that
// keeping count of them changes nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/parallel/thread_pool.h"
#include "mpm/solver/solver.h"
#include "tests/gpu_only.h"
#include "tests/mpm/changing_scenes.h"

namespace graupel::mpm {
namespace {

constexpr double g = 9.8;

Obstacle plate_at(const Vec3d& centre, const Vec3d& size) {
  Obstacle plate;
  plate.shape = Shape::box;
  plate.position = centre;
  plate.size = size;
  return plate;
}

/// A run that keeps count of the forces, with sums over its frames.
struct ForceRun {
  explicit ForceRun(const Scene& read_scene, SimulationOptions options = {.precision = Precision::f64})
      : scene(read_scene), names(contact_names(read_scene)), total(names.size()) {
    options.contact_forces = true;
    run = Simulation::create(scene, options);
    begin = run->diagnostics();
  }
  void frames(int n) {
    for (int f = 0; f < n; ++f) {
      run->advance_frame();
      const std::vector<ContactForce> now = run->contact_forces();
      ASSERT_EQ(now.size(), names.size());
      for (std::size_t i = 0; i < now.size(); ++i) {
        total[i].impulse += now[i].impulse;
        total[i].torque += scene.frame_time * (now[i].torque + cross(now[i].reference, now[i].force));
      }
      ++done;
    }
  }
  /// Forgets the frames so far.
  void restart() {
    std::fill(total.begin(), total.end(), ContactForce{});
    done = 0;
  }
  double seconds() const { return done * scene.frame_time; }
  Vec3d mean_force(const std::string& name) const { return (1 / seconds()) * of(name).impulse; }
  const ContactForce& of(const std::string& name) const {
    const auto at = std::find(names.begin(), names.end(), name);
    EXPECT_NE(at, names.end()) << name;
    return total[static_cast<std::size_t>(at - names.begin())];
  }
  Vec3d impulse() const {
    Vec3d sum = Vec3d::zero();
    for (const ContactForce& one : total) sum += one.impulse;
    return sum;
  }
  /// Momentum that the matter gained beyond gravity's, loads' and scripts', and gave to nobody: zero.
  Vec3d imbalance() const {
    const RunStatistics s = run->statistics();
    const Vec3d gained = run->diagnostics().momentum - begin.momentum;
    return gained - (begin.mass * seconds()) * scene.gravity - s.load_momentum - s.scripted_momentum + impulse();
  }

  Scene scene;
  std::vector<std::string> names;
  std::vector<ContactForce> total;  ///< impulse [N s]; torque: angular impulse about the origin [N m s]
  std::unique_ptr<Simulation> run;
  Diagnostics begin;
  int done = 0;
};

/// Momentum after `frames` is what gravity, loads and contact gave, to round-off; and contact gave something.
void expect_balance(const Scene& scene, const SimulationOptions& options, int frames, const std::string& what) {
  ForceRun run(scene, options);
  run.frames(frames);
  const double round_off = options.precision == Precision::f64 ? 1e-13 : 1e-5;
  const double scale = norm(run.impulse()) + run.begin.mass * run.seconds() * norm(scene.gravity);
  EXPECT_LT(norm(run.imbalance()), round_off * scale) << what;
  EXPECT_GT(norm(run.impulse()), 0.02 * norm(run.begin.momentum)) << what;
}

constexpr SimulationOptions f64_options = {.precision = Precision::f64};

TEST(ContactForces, MomentumBalancesToRoundOff) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable}) {
    const std::string name = kernels == Kernels::tuned ? "tuned" : "portable";
    expect_balance(four_materials(), {.precision = Precision::f64, .kernels = kernels}, 10, name + ", f64");
    expect_balance(four_materials(), {.kernels = kernels}, 10, name + ", f32");
  }
}

TEST(ContactForces, PushedOutParticlesAreInTheBalance) {
  ForceRun run(four_materials());
  run.frames(10);
  EXPECT_GT(run.run->statistics().pushed_out, 0);
  EXPECT_GT(norm(run.run->statistics().pushed_out_momentum), 1e-6 * norm(run.impulse()));
}

TEST(ContactForces, MomentumBalancesWithEveryContactOfObstacleAndWall) {
  for (const Contact contact : {Contact::stick, Contact::slip, Contact::separate}) {
    Scene scene = four_materials();
    scene.obstacles[0].contact = scene.domain.walls = contact;
    scene.domain.wall_friction = 0.3;
    expect_balance(scene, f64_options, 10, "contact " + std::to_string(static_cast<int>(contact)));
  }
}

TEST(ContactForces, MomentumBalancesWithMovingObstacles) {
  Scene scene = four_materials();
  scene.obstacles[0].motion = Motion{};
  scene.obstacles[0].motion->velocity = {0.2, 0.1, 0};
  scene.obstacles[0].motion->spin = 5;
  scene.obstacles[0].contact = Contact::stick;
  scene.obstacles.push_back(plate_at({0.58, 0.0575, 0.43}, {0.1, 0.02, 0.2}));
  expect_balance(scene, f64_options, 10, "one of two moves");
}

TEST(ContactForces, MomentumBalancesInThePlane) {
  expect_balance(in_the_plane(four_materials()), f64_options, 10, "two dimensions");
}

/// At the edges of the domain a node obeys two or three walls, and particles are pushed off several at once.
TEST(ContactForces, MomentumBalancesInACorner) {
  for (const Contact contact : {Contact::stick, Contact::slip, Contact::separate}) {
    Scene scene = scene_with("taichi_water", {0.1, 0.1, 0.1}, 0.08);
    scene.sources[0].velocity = {-3, -4, -2};
    scene.domain.walls = contact;
    scene.domain.wall_friction = 0.3;
    set_steps(scene, 20, 3e-4);
    const std::string name = "contact " + std::to_string(static_cast<int>(contact));
    expect_balance(scene, f64_options, 10, name);
    expect_balance(in_the_plane(scene), f64_options, 10, name + ", in the plane");
  }
}

TEST(ContactForces, MomentumBalancesWithCubicSplinesAndDamping) {
  Scene scene = four_materials();
  scene.transfer.spline = Spline::cubic;
  expect_balance(scene, f64_options, 10, "cubic");
  scene = four_materials();
  scene.transfer.damping = 5;
  expect_balance(scene, f64_options, 10, "damped");
}

/// Nodes one period apart hold the same sums; counted twice, the floor under them would carry more than there is.
TEST(ContactForces, MomentumBalancesThroughPeriodicWalls) {
  Scene scene = scene_with("taichi_water", {0.5, 0.15, 0.5}, 0.2);
  scene.domain.size = {0.5, 0.5, 0.5};
  scene.domain.dx = 1.0 / 32;
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  scene.sources[0].position = {0.25, 0.15, 0.25};
  scene.sources[0].size = {0.3, 0.1, 0.1};
  scene.sources[0].velocity = {2, -1, 0};
  set_steps(scene, 20, 5e-4);
  expect_balance(scene, f64_options, 10, "periodic");
}

TEST(ContactForces, MomentumBalancesWithALoadAndAScript) {
  Scene scene = four_materials();
  scene.loads.emplace_back();
  scene.loads[0].place = {0.4, 0.12, 0.5};
  scene.loads[0].radius = 0.03;
  scene.loads[0].force = {3, -5, 1};
  scene.loads[0].duration = 0.02;
  scene.sources[1].motion = Motion{};
  scene.sources[1].motion->velocity = {0, -1, 0};
  scene.sources[1].motion->end_time = 0.03;
  scene.sources[1].velocity = {0, 0, 0};
  expect_balance(scene, f64_options, 5, "load and script");
}

/// Without gravity and push-out, the angular momentum that is lost is the angular impulse about the same point.
TEST(ContactForces, AngularMomentumBalancesToRoundOff) {
  Scene scene = scene_with("jelly", {0.5, 0.5, 0.5}, 0.08);
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {1, -2, 0.5};
  scene.push_out = false;
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.08;
  ball.position = {0.53, 0.36, 0.49};
  ball.friction = 0.4;
  scene.obstacles = {ball};
  set_steps(scene, 20, 2e-4);
  ForceRun run(scene);
  run.frames(10);
  const Vec3d lost = run.begin.angular_momentum - run.run->diagnostics().angular_momentum;
  const Vec3d given = run.of("obstacle_0").torque;
  EXPECT_GT(norm(given), 0.05 * norm(run.begin.angular_momentum));
  EXPECT_LT(norm(lost - given), 1e-11 * norm(run.begin.angular_momentum));
  EXPECT_LT(norm(run.imbalance()), 1e-12 * norm(run.begin.momentum));
}

/// Water that fills a tank between the walls to 8 cells.
Scene tank() {
  Scene scene = scene_with("taichi_water");
  scene.domain.dx = 1.0 / 64;
  scene.domain.size = {0.25, 0.3125, 0.25};
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  scene.sources[0].size = {high[0] - low[0], 0.125, high[2] - low[2]};
  scene.sources[0].position = {0.125, low[1] + 0.0625, 0.125};
  scene.sources[0].sampling = Sampling::jittered_lattice;
  set_steps(scene, 40, 2.5e-4);
  return scene;
}

TEST(ContactForces, WaterAtRestWeighsOnTheFloorOfItsTank) {
  ForceRun run(tank(), {});
  run.frames(25);  // it settles
  run.restart();
  run.frames(20);
  const double weight = g * run.begin.mass;
  EXPECT_NEAR(run.mean_force("wall_y_low")[1], -weight, 0.02 * weight);
  EXPECT_LT(norm(run.mean_force("wall_y_high")), 1e-6 * weight);
  const double across = run.mean_force("wall_x_low")[0] + run.mean_force("wall_x_high")[0];
  EXPECT_LT(std::abs(across), 0.02 * weight);
  EXPECT_LT(run.mean_force("wall_x_low")[0], 0);  // outwards
  EXPECT_GT(run.mean_force("wall_x_high")[0], 0);
}

TEST(ContactForces, WaterAtRestWeighsOnTheObstacleBelowIt) {
  Scene scene = tank();
  const Vec3d low = scene.wall_low();
  scene.obstacles = {plate_at({0.125, low[1] + 0.01, 0.125}, {0.25, 0.06, 0.25})};
  scene.sources[0].position[1] += 0.04;
  ForceRun run(scene, {});
  run.frames(25);
  run.restart();
  run.frames(20);
  const double weight = g * run.begin.mass;
  EXPECT_NEAR(run.mean_force("obstacle_0")[1], -weight, 0.02 * weight);
  EXPECT_LT(norm(run.mean_force("wall_y_low")), 1e-3 * weight);
}

/// Two blocks of different weight on two plates; the torque of each block, which stands beside the middle of its plate.
TEST(ContactForces, EachObstacleHasTheForceAndTorqueOfWhatStandsOnIt) {
  Scene scene = scene_with("jelly", {0.3, 0.265, 0.5}, 0.08);
  add_box(scene, "jelly", {0.7, 0.285, 0.5}, 0.12);
  scene.obstacles = {plate_at({0.32, 0.2, 0.5}, {0.2, 0.05, 0.2}), plate_at({0.66, 0.2, 0.5}, {0.26, 0.05, 0.2})};
  for (Obstacle& plate : scene.obstacles) plate.contact = Contact::stick;
  set_steps(scene, 50, 2e-4);
  ForceRun run(scene, {});
  run.frames(40);
  const double density = preset("jelly").density,
               weights[] = {g * density * std::pow(0.08, 3), g * density * std::pow(0.12, 3)};
  const double arm[] = {0.3 - 0.32, 0.7 - 0.66};
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = "obstacle_" + std::to_string(i);
    const Vec3d force = run.mean_force(name);
    EXPECT_NEAR(force[1], -weights[i], 0.03 * weights[i]) << name;
    EXPECT_LT(std::hypot(force[0], force[2]), 0.02 * weights[i]) << name;
    const Vec3d torque = (1 / run.seconds()) * run.of(name).torque - cross(run.scene.obstacles[i].position, force);
    EXPECT_NEAR(torque[2], -arm[i] * weights[i], 0.05 * std::abs(arm[i]) * weights[i]) << name;
  }
}

/// A block that slides over a floor: friction is mu times the normal force, against the motion.
TEST(ContactForces, FrictionIsItsShareOfTheNormalForce) {
  Scene scene = scene_with("jelly", {0.3, 3.0 / 64 + 0.04, 0.5}, 0.08);
  scene.domain.wall_friction = 0.2;
  scene.sources[0].velocity = {2, 0, 0};
  set_steps(scene, 50, 2e-4);
  ForceRun run(scene, {});
  run.frames(10);
  const Vec3d force = run.mean_force("wall_y_low");
  EXPECT_NEAR(force[0], -0.2 * force[1], 1e-3 * std::abs(force[1]));
  EXPECT_LT(force[1], -0.5 * g * run.begin.mass);
}

TEST(ContactForces, ReferencePointsFollowTheMotion) {
  Scene scene = scene_with("jelly");
  scene.obstacles = {plate_at({0.2, 0.2, 0.2}, {0.05, 0.05, 0.05}), plate_at({0.7, 0.2, 0.7}, {0.05, 0.05, 0.05})};
  scene.obstacles[1].motion = Motion{};
  scene.obstacles[1].motion->velocity = {-1, 0.5, 0};
  scene.obstacles[1].motion->center = Vec3d{0.6, 0.2, 0.7};
  set_steps(scene, 20, 1e-3);
  ForceRun run(scene);
  run.frames(2);
  const std::vector<ContactForce> now = run.run->contact_forces();
  EXPECT_LT(norm(now[0].reference - Vec3d{0.2, 0.2, 0.2}), 1e-12);
  EXPECT_LT(norm(now[1].reference - Vec3d{0.56, 0.22, 0.7}), 1e-12);
  EXPECT_EQ(run.names[2], "wall_x_low");
  EXPECT_LT(norm(now[2].reference - Vec3d{3.0 / 64, 0.5, 0.5}), 1e-12);
  for (const ContactForce& one : now) EXPECT_TRUE(one.impulse == Vec3d::zero());  // nothing touches yet
}

/// A jet of water on a plate far wider than itself gives it rho A v^2.
TEST(ContactForces, AJetPushesAPlateByItsMomentumFlux) {
  const double speed = 4, side = 0.125;
  Scene scene = scene_with("taichi_water");
  scene.gravity = {0, 0, 0};
  scene.domain.dx = 1.0 / 64;
  scene.domain.size = {0.7, 0.4, 0.7};
  for (int axis = 0; axis < 3; ++axis)
    for (int wall = 0; wall < 2; ++wall) scene.domain.faces.at(axis, wall) = WallConfig{Wall::open, {}};
  scene.sources[0].size = {side, 0.02, side};
  scene.sources[0].position = {0.35, 0.16, 0.35};
  scene.sources[0].velocity = {0, -speed, 0};
  scene.sources[0].sampling = Sampling::jittered_lattice;
  Emitter jet;
  jet.shape = Shape::box;
  jet.size = {side, 0.02, side};
  jet.position = {0.35, 0.2, 0.35};
  jet.velocity = {0, -speed, 0};
  jet.material = "taichi_water";
  jet.particles_per_cell = scene.sources[0].particles_per_cell = 4;
  scene.emitters = {jet};
  scene.obstacles = {plate_at({0.35, 0.09, 0.35}, {0.68, 0.06, 0.68})};
  set_steps(scene, 50, 2e-4);
  ForceRun run(scene, {});
  run.frames(8);
  run.restart();
  run.frames(8);
  const double flux = preset("taichi_water").density * side * side * speed * speed;
  EXPECT_NEAR(run.mean_force("obstacle_0")[1], -flux, 0.05 * flux);
}

void expect_same_frames(const Scene& scene, SimulationOptions options, const std::string& what) {
  const auto without = Simulation::create(scene, options);
  options.contact_forces = true;
  const auto with = Simulation::create(scene, options);
  for (int f = 0; f < 5; ++f) {
    without->advance_frame();
    with->advance_frame();
  }
  EXPECT_TRUE(without->contact_forces().empty());
  const ParticleFrame a = without->frame(), b = with->frame();
  EXPECT_TRUE(a.position == b.position) << what;
  EXPECT_TRUE(a.velocity == b.velocity) << what;
}

TEST(ContactForces, KeepingCountChangesNoParticle) {
  for (const Kernels kernels : {Kernels::tuned, Kernels::portable})
    for (const Precision precision : {Precision::f32, Precision::f64})
      expect_same_frames(four_materials(), {.precision = precision, .kernels = kernels},
                         kernels == Kernels::tuned ? "tuned" : "portable");
}

TEST(ContactForces, DoNotDependOnThreads) {
  const int threads = num_threads();
  std::vector<ContactForce> found[2];
  for (const int n : {1, 2}) {
    set_num_threads(n);
    ForceRun run(four_materials(), {});
    run.frames(5);
    found[n - 1] = run.run->contact_forces();
  }
  set_num_threads(threads);
  EXPECT_TRUE(found[0] == found[1]);
}

TEST(ContactForces, OfAFrameMadeOfSubstepsAreThoseOfTheFrame) {
  const SimulationOptions options{.contact_forces = true};
  const auto whole = Simulation::create(four_materials(), options),
             parts = Simulation::create(four_materials(), options);
  for (int f = 0; f < 4; ++f) {
    whole->advance_frame();
    while (!parts->advance_substep()) {
    }
    EXPECT_TRUE(whole->contact_forces() == parts->contact_forces()) << f;
  }
}

TEST(ContactForces, OfARestoredRunAreThoseOfTheUninterruptedOne) {
  const SimulationOptions options{.contact_forces = true};
  const auto first = Simulation::create(four_materials(), options),
             second = Simulation::create(four_materials(), options);
  for (int f = 0; f < 3; ++f) first->advance_frame();
  second->load_state(first->save_state());
  first->advance_frame();
  second->advance_frame();
  EXPECT_TRUE(first->contact_forces() == second->contact_forces());
}

TEST(ContactForcesGpu, EqualThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  Scene moving = four_materials();
  moving.obstacles[0].motion = Motion{};
  moving.obstacles[0].motion->velocity = {0.2, 0.1, 0};
  for (const Scene& scene : {four_materials(), moving, in_the_plane(four_materials())}) {
    ForceRun cpu(scene, {}), gpu(scene, {.device = Device::cuda});
    cpu.frames(2);
    gpu.frames(2);
    for (std::size_t i = 0; i < cpu.total.size(); ++i) {
      EXPECT_LT(norm(cpu.total[i].impulse - gpu.total[i].impulse), 1e-3 * norm(cpu.impulse())) << cpu.names[i];
      EXPECT_LT(norm(cpu.total[i].torque - gpu.total[i].torque), 1e-3 * norm(cpu.impulse())) << cpu.names[i];
    }
    EXPECT_LT(norm(gpu.imbalance()), 1e-4 * norm(gpu.impulse()));
  }
}

}  // namespace
}  // namespace graupel::mpm
