// Scenes with two dimensions, and both splines: plane strain, conservation, the same result for any number of threads,
// and everything else that a scene may have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/fast_step.h"
#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

constexpr double dx = 1.0 / 32;

/// Two blocks in one layer of particles that collide above the floor, in a box without gravity along z.
Scene collision(const std::string& material) {
  Scene scene;
  scene.domain.dx = dx;
  scene.materials[material] = preset(material);
  for (const double side : {-1.0, 1.0}) {
    Source source = box_source(material, {0.5 + 0.12 * side, 0.25, 0.5}, {0.2, 0.2, dx});
    source.velocity = {-2 * side, -1, 0};
    scene.sources.push_back(source);
  }
  scene.frame_time = 2e-3;
  return scene;
}

Scene with_form(Scene scene, int dimensions, Spline spline) {
  scene.transfer.spline = spline;
  return dimensions == 2 ? in_the_plane(scene) : scene;
}

template <typename Check>
void for_all_forms(const Scene& scene, const Check& check) {
  for (const int dimensions : {2, 3})
    for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
      SCOPED_TRACE(testing::Message() << dimensions << " dimensions, " << word_of(spline));
      check(with_form(scene, dimensions, spline));
    }
}

template <typename T>
std::unique_ptr<Solver<T>> solver_of(const Scene& scene) {
  return std::make_unique<Solver<T>>(scene, SimulationOptions{}, sample_sources(scene, 1),
                                     sparsegrid::ObstacleSet(scene));
}

/// The plane's particles as one layer in the middle of a slab one cell thick between slip walls: all nodes of the slab
/// lie on or behind these walls, so that nothing moves along z or depends on it.
Scene slab_of(const Scene& plane) {
  Scene slab = plane;
  slab.domain.dimensions = 3;
  const double margin = static_cast<double>(slab.domain.wall_cells) * dx;
  slab.domain.origin[2] = plane.domain.plane() - dx / 2 - margin;
  slab.domain.size[2] = dx + 2 * margin;
  slab.domain.faces.z_low = slab.domain.faces.z_high = WallConfig{Wall::slip, {}};
  const SampledParticles sampled = sample_sources(plane, 1);
  for (std::size_t s = 0; s < slab.sources.size(); ++s) {
    std::vector<Vec3d> points;
    for (std::size_t i = 0; i < sampled.position.size(); ++i)
      if (sampled.source[i] == static_cast<int32_t>(s)) points.push_back(sampled.position[i]);
    slab.sources[s].shape = Shape::points;
    slab.sources[s].points = std::make_shared<const std::vector<Vec3d>>(points);
    slab.sources[s].position = {0, 0, 0};
  }
  return slab;
}

TEST(Plane, IsASlabBetweenSlipWallsToRounding) {
  for (const char* material : {"taichi_water", "jelly", "snow", "sand", "metal"})
    for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
      SCOPED_TRACE(testing::Message() << material << ", " << word_of(spline));
      const Scene plane = with_form(collision(material), 2, spline);
      const auto flat = solver_of<double>(plane), thick = solver_of<double>(slab_of(plane));
      ASSERT_EQ(flat->particle_count(), thick->particle_count());
      const double before = flat->diagnostics().kinetic_energy;
      for (int f = 0; f < 25; ++f) {
        flat->advance_frame();
        thick->advance_frame();
      }
      EXPECT_LT(flat->diagnostics().kinetic_energy, 0.9 * before);  // they did meet
      const ParticleFrame a = flat->frame(), b = thick->frame();
      float worst = 0;
      for (std::size_t i = 0; i < a.position.size(); ++i) worst = std::max(worst, norm(a.position[i] - b.position[i]));
      EXPECT_LT(worst, 1e-5f);  // frames are in f32, and what yields grows rounding errors
      const double energy = flat->diagnostics().elastic_energy, same = thick->diagnostics().elastic_energy / dx;
      EXPECT_NEAR(energy, same, 1e-5 * before);
    }
}

TEST(Plane, NothingMovesAcrossIt) {
  const auto solver = solver_of<float>(with_form(collision("sand"), 2, Spline::quadratic));
  for (int f = 0; f < 25; ++f) solver->advance_frame();
  const HostParticles<float> p = solver->particles();
  float stress = 0, across = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    ASSERT_EQ(p.position[i][2], 0.5f);
    ASSERT_EQ(p.velocity[i][2], 0.0f);
    for (int d = 0; d < 3; ++d) {
      ASSERT_EQ(p.affine_velocity[i](2, d), 0.0f);
      ASSERT_EQ(p.affine_velocity[i](d, 2), 0.0f);
    }
    stress = std::max(stress, std::abs(p.stress[i][2]));
    across = std::max(across, std::abs(p.deformation_gradient[i](2, 2) - 1));
  }
  EXPECT_GT(stress, 100.0f);  // it carries stress across, as plane strain does
  EXPECT_GT(across, 1e-6f);   // and the elastic part of its strain is not zero where it flows
}

/// Random velocities, affine velocities and stresses, in the plane where the scene is.
void disturb(Solver<double>& solver, bool plane) {
  const ParticleView<double> p = solver.view().particles;
  for (int64_t slot = 0; slot < p.count; ++slot) {
    const auto seed = static_cast<uint64_t>(slot);
    Mat3d C = random_matrix<double, 3>(3 * seed, 20), stress = random_matrix<double, 3>(3 * seed + 1, 1e4);
    Vec3d v = random_matrix<double, 3>(3 * seed + 2, 2) * Vec3d{1, 0, 0};
    if (plane) {
      C = in_space(in_axes<2>(C));
      v[2] = 0;
    }
    p.velocity.set_vec(slot, v);
    store_matrix<double, 3>(p.affine_velocity, slot, C);
    store_symmetric(p.stress, slot, stress + transpose(stress));
  }
}

TEST(Forms, ASubstepConservesBothMomenta) {
  Scene scene = scene_with("jelly", {0.5, 0.6, 0.5}, 0.2);
  scene.gravity = {0, 0, 0};
  scene.domain.dx = dx;
  for_all_forms(scene, [](const Scene& s) {
    const auto solver = solver_of<double>(s);
    disturb(*solver, s.domain.is_plane());
    const Diagnostics before = solver->diagnostics();
    solver->substep(1e-4);
    const Diagnostics after = solver->diagnostics();
    EXPECT_LT(norm(after.momentum - before.momentum), 1e-13 * before.mass);
    EXPECT_LT(norm(after.angular_momentum - before.angular_momentum), 1e-13 * before.mass);
  });
}

TEST(Forms, ASubstepKeepsAffineFields) {
  Scene scene = scene_with("jelly", {0.5, 0.6, 0.5}, 0.2);
  scene.gravity = {0, 0, 0};
  scene.domain.dx = dx;
  for_all_forms(scene, [](const Scene& s) {
    const auto solver = solver_of<double>(s);
    Mat3d A = random_matrix<double, 3>(1, 1);
    Vec3d b = {0.3, -0.2, 0.5};
    if (s.domain.is_plane()) {
      A = in_space(in_axes<2>(A));
      b[2] = 0;
    }
    const ParticleView<double> p = solver->view().particles;
    for (int64_t slot = 0; slot < p.count; ++slot) {
      p.velocity.set_vec(slot, A * p.position.vec(slot) + b);
      store_matrix<double, 3>(p.affine_velocity, slot, A);
    }
    const HostParticles<double> before = solver->particles();
    solver->substep(1e-3);
    const HostParticles<double> after = solver->particles();
    for (std::size_t i = 0; i < after.size(); ++i) {
      ASSERT_LT(norm(after.velocity[i] - before.velocity[i]), 1e-13);
      ASSERT_LT(largest_entry(after.affine_velocity[i] - A), 1e-12);
      ASSERT_LT(largest_entry(after.deformation_gradient[i] - (Mat3d::identity() + 1e-3 * A)), 1e-14);
    }
  });
}

TEST(Forms, TheNumberOfThreadsDoesNotShow) {
  for_all_forms(collision("sand"), [](const Scene& s) {
    const auto one = Simulation::create(s, {}), two = Simulation::create(s, {});
    set_num_threads(1);
    for (int f = 0; f < 10; ++f) one->advance_frame();
    set_num_threads(2);
    for (int f = 0; f < 10; ++f) two->advance_frame();
    set_num_threads(0);
    EXPECT_TRUE(one->save_state() == two->save_state());
  });
}

/// A cubic stencil lies inside the grid where the particles may be, at the faces of a domain without push-out too.
TEST(Forms, MaterialMayLieOnTheWalls) {
  for (const bool push_out : {true, false}) {
    Scene scene = collision("taichi_water");
    scene.domain.wall_cells = 2;
    scene.push_out = push_out;
    scene.sources[0].velocity = {-6, -6, 0};
    scene.sources[1].velocity = {6, 6, 0};
    for_all_forms(scene, [](const Scene& s) {
      const auto sim = Simulation::create(s, {});
      for (int f = 0; f < 60; ++f) ASSERT_NO_THROW(sim->advance_frame());
      const Vec3d low = s.domain.origin + Vec3d::filled(dx), high = s.domain.origin + s.domain.size - Vec3d::filled(dx);
      for (const Vec3f& x : sim->frame().position)
        for (int d = 0; d < s.domain.axes(); ++d) {
          ASSERT_GT(x[d], static_cast<float>(low[d]) - 1e-6f - (s.push_out ? 0 : 0.5f * static_cast<float>(dx)));
          ASSERT_LT(x[d], static_cast<float>(high[d]) + 1e-6f + (s.push_out ? 0 : 0.5f * static_cast<float>(dx)));
        }
    });
  }
}

Scene with_obstacle(Obstacle obstacle) {
  Scene scene = in_the_plane(collision("taichi_water"));
  for (Source& source : scene.sources) source.position[1] = 0.7;
  scene.frame_time = 1.0 / 60;
  scene.obstacles.push_back(std::move(obstacle));
  return scene;
}

/// The plane cuts a ball beside its centre: the material meets the section, a disk.
TEST(Plane, ObstaclesHoldTheMaterialOutOfTheirSection) {
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.2;
  ball.position = {0.5, 0.3, 0.62};
  const double section = std::sqrt(0.2 * 0.2 - 0.12 * 0.12);
  for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
    Scene scene = with_obstacle(ball);
    scene.transfer.spline = spline;
    const auto sim = Simulation::create(scene, {});
    double nearest = 1;
    for (int f = 0; f < 40; ++f) {
      sim->advance_frame();
      for (const Vec3f& x : sim->frame().position) {
        ASSERT_EQ(x[2], 0.5f);
        nearest = std::min(nearest, std::hypot(static_cast<double>(x[0]) - 0.5, static_cast<double>(x[1]) - 0.3));
      }
    }
    EXPECT_GT(nearest, section - 0.1 * dx);
    EXPECT_LT(nearest, section + dx);
  }
}

TEST(Plane, MovingObstaclesCarryMaterial) {
  Obstacle plate;
  plate.size = {0.6, 0.1, 0.2};
  plate.position = {0.5, 0.45, 0.5};
  plate.contact = Contact::stick;
  plate.motion = Motion{};
  plate.motion->velocity = {0, 0.2, 0};
  plate.motion->spin = 0.3;
  plate.motion->axis = {0, 0, 1};
  const Scene scene = with_obstacle(plate);
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 30; ++f) sim->advance_frame();
  int carried = 0;
  for (const Vec3f& x : sim->frame().position) {
    ASSERT_EQ(x[2], 0.5f);
    carried += x[1] > 0.55f;
  }
  EXPECT_GT(carried, static_cast<int>(sim->particle_count() / 2));
}

TEST(Plane, EmittersSinksAndGatesWork) {
  Scene scene = in_the_plane(collision("taichi_water"));
  scene.frame_time = 1.0 / 60;
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.1, 0.05, 0.3};
  emitter.position = {0.5, 0.8, 0.45};
  emitter.velocity = {0.2, -1, 0};
  emitter.end_time = 0.2;
  emitter.material = "taichi_water";
  emitter.particles_per_cell = 4;
  scene.emitters.push_back(emitter);
  Sink sink;
  sink.position = {0.8, 0.1, 0.5};
  sink.size = {0.2, 0.2, 0.1};
  scene.sinks.push_back(sink);
  scene.domain.faces.x_low = WallConfig{Wall::open, {}};
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 60; ++f) sim->advance_frame();
  const double length = std::hypot(0.2, 1.0), spacing = dx / 2;
  // The width of the box across the stream, and the stream's length, in particles of a full lattice.
  const double width = (0.1 * 1 + 0.05 * 0.2) / length, expected = width * length * 0.2 / (spacing * spacing);
  EXPECT_NEAR(static_cast<double>(sim->statistics().born), expected, 0.15 * expected);
  EXPECT_GT(sim->statistics().removed, 100);
  for (const Vec3f& x : sim->frame().position) ASSERT_EQ(x[2], 0.5f);
}

/// A body that flies through a periodic wall feels nothing.
TEST(Plane, PeriodicWallsAreNoWalls) {
  for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
    Scene scene = in_the_plane(scene_with("jelly"));
    scene.gravity = {0, 0, 0};
    scene.transfer.spline = spline;
    scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
    scene.domain.faces.y_low = scene.domain.faces.y_high = WallConfig{Wall::periodic, {}};
    scene.sources[0].velocity = {6, 4, 0};
    const auto sim = Simulation::create(scene, {.precision = Precision::f64});
    for (int f = 0; f < 12; ++f) sim->advance_frame();
    const Diagnostics d = sim->diagnostics();
    EXPECT_NEAR(d.momentum[0], 6 * d.mass, 1e-10 * d.mass);
    EXPECT_NEAR(d.momentum[1], 4 * d.mass, 1e-10 * d.mass);
    EXPECT_LT(d.elastic_energy, 1e-12 * d.mass);
  }
}

TEST(Plane, LedParticlesFollowTheirScript) {
  Scene scene = in_the_plane(scene_with("jelly", {0.5, 0.5, 0.5}, 0.2));
  scene.time_step.policy = StepPolicy::adaptive;
  scene.sources[0].motion = Motion{};
  scene.sources[0].motion->spin = 2;
  scene.sources[0].motion->axis = {0, 0, 1};
  const auto sim = Simulation::create(scene, {});
  const ParticleFrame before = sim->frame();
  for (int f = 0; f < 10; ++f) sim->advance_frame();
  const ParticleFrame after = sim->frame();
  const RigidMap pose = scene.sources[0].motion->at(10.0 / 60, {0.5, 0.5, 0.5});
  for (std::size_t i = 0; i < after.position.size(); ++i)
    ASSERT_LT(norm(after.position[i].cast<double>() - pose(before.position[i].cast<double>())), 1e-4);
}

TEST(Plane, TheCoarseVariantHasAQuarterOfTheParticles) {
  Scene scene = in_the_plane(scene_with("water", {0.5, 0.5, 0.5}, 0.5));
  const Scene coarse = coarse_variant(scene);
  EXPECT_LT(norm(coarse.wall_low() - scene.wall_low()) + norm(coarse.wall_high() - scene.wall_high()), 1e-12);
  EXPECT_DOUBLE_EQ(coarse.domain.plane(), scene.domain.plane());
  const auto n = static_cast<double>(Simulation::create(scene, {})->particle_count());
  EXPECT_NEAR(static_cast<double>(Simulation::create(coarse, {})->particle_count()), n / 4, 2);
  Source& source = scene.sources[0];
  const SampledParticles sampled = sample_sources(scene, 1);
  source.shape = Shape::points;
  source.points = std::make_shared<const std::vector<Vec3d>>(sampled.position);
  source.position = {0, 0, 0};
  const Diagnostics fine = Simulation::create(scene, {})->diagnostics(),
                    rough = Simulation::create(coarse_variant(scene), {})->diagnostics();
  EXPECT_NEAR(rough.mass, fine.mass, 0.005 * fine.mass);
}

TEST(Plane, TheSearchForALargeStepWorks) {
  Scene scene = in_the_plane(scene_with("taichi_water", {0.5, 0.2, 0.5}, 0.2));
  const FastStep step = find_fast_step(scene, {}, 5);
  EXPECT_LT(step.substeps, step.data_substeps);
  EXPECT_EQ(step.scene.domain.dimensions, 2);
}

std::string error_of(const Scene& scene) {
  try {
    Simulation::create(scene, {});
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(PlaneErrors, WhatLeadsOutOfThePlaneIsNamed) {
  using testing::HasSubstr;
  const Scene good = in_the_plane(collision("jelly"));
  EXPECT_EQ(error_of(good), "");
  Scene bad = good;
  bad.domain.dimensions = 4;
  EXPECT_THAT(error_of(bad), HasSubstr("domain.dimensions must be 2 or 3 (4)"));
  bad = good;
  bad.gravity[2] = 1;
  EXPECT_THAT(error_of(bad), HasSubstr("gravity leads out of the plane"));
  bad = good;
  bad.sources[1].position[2] = 0.9;
  EXPECT_THAT(error_of(bad), HasSubstr("source 1 (box of 'jelly') does not reach the plane"));
}

TEST(Plane, SceneOfABatchMovesAsAlone) {
  for (const Device device : {Device::cpu, Device::cuda}) {
    if (device == Device::cuda && !cuda_available()) continue;
    for (const Scene& scene :
         {with_form(collision("jelly"), 2, Spline::quadratic), with_form(collision("jelly"), 3, Spline::cubic)}) {
      const PreparedScene prepared(scene, {.device = device});
      const auto batch = SceneBatch::create({prepared, prepared});
      const auto alone = Simulation::create(prepared);
      batch->advance_frame();
      alone->advance_frame();
      for (const ParticleFrame& frame : batch->frames({})) EXPECT_TRUE(frame.position == alone->frame().position);
    }
  }
}

/// A body sampled in the plane z = 0.5: its mass [kg/m] over the density.
double area_of(Source source, Sampling sampling) {
  Scene scene = in_the_plane(scene_with("jelly"));
  source.material = "jelly";
  source.sampling = sampling;
  scene.sources = {source};
  const SampledParticles p = sample_sources(scene, 7);
  double sum = 0;
  for (std::size_t i = 0; i < p.position.size(); ++i) {
    EXPECT_EQ(p.position[i][2], 0.5);
    sum += p.volume[i];
  }
  return sum;
}

TEST(PlaneSampling, SectionsHaveTheirArea) {
  Source ball = box_source("jelly", {0.5, 0.5, 0.62}, {1, 1, 1});
  ball.shape = Shape::sphere;
  ball.radius = 0.2;
  const double disk = 3.14159265 * (0.2 * 0.2 - 0.12 * 0.12);
  Source box = box_source("jelly", {0.5, 0.5, 0.5}, {0.3, 0.2, 0.05});
  Source turned = box;
  turned.rotation_axis = {0, 0, 1};
  turned.rotation_angle = 30;
  Source tilted = box_source("jelly", {0.5, 0.5, 0.5}, {0.3, 0.2, 0.6});
  tilted.rotation_axis = {1, 0, 0};
  tilted.rotation_angle = 20;
  for (const Sampling sampling : {Sampling::random, Sampling::jittered_lattice}) {
    EXPECT_NEAR(area_of(ball, sampling), disk, 0.01 * disk);
    EXPECT_NEAR(area_of(box, sampling), 0.06, 0.0006);
    EXPECT_NEAR(area_of(turned, sampling), 0.06, 0.0006);
    EXPECT_NEAR(area_of(tilted, sampling), 0.06 / std::cos(20 * 3.14159265 / 180), 0.0006);
  }
}

TEST(PlaneSampling, ALatticeHasItsParticlesInEveryCell) {
  Scene scene = in_the_plane(scene_with("jelly", {0.5, 0.5, 0.5}, 0.25));
  scene.sources[0].sampling = Sampling::jittered_lattice;
  scene.sources[0].particles_per_cell = 4;
  std::vector<int> count(16 * 16, 0);
  for (const Vec3d& x : sample_sources(scene, 3).position)
    ++count[static_cast<std::size_t>((x[0] - 0.375) * 64) * 16 + static_cast<std::size_t>((x[1] - 0.375) * 64)];
  for (const int n : count) EXPECT_EQ(n, 4);
}

}  // namespace
}  // namespace graupel::mpm
