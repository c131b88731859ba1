// All models in one run: both forms of the update, exact restart, stationary particles, and step sizes that each
// model's waves and viscosity allow.
#include <gtest/gtest.h>

#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <typename T>
std::unique_ptr<Solver<T>> solver_of(const Scene& scene) {
  return std::make_unique<Solver<T>>(scene, SimulationOptions{}, sample_sources(scene, 1),
                                     sparsegrid::ObstacleSet(scene));
}

template <typename T>
void check_deformation() {
  const Scene scene = every_model();
  const auto solver = solver_of<T>(scene), twin = solver_of<T>(scene);
  for (auto* s : {solver.get(), twin.get()}) s->advance_frame();
  const T dt = T(1e-4), tolerance = sizeof(T) == 4 ? T(3e-5) : T(1e-11);
  update_deformation_tiles(solver->view(), dt);
  update_deformation_portable(twin->view(), dt);
  const HostParticles<T> a = solver->particles(), b = twin->particles();
  T flowed = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_LT(largest_entry(a.deformation_gradient[i] - b.deformation_gradient[i]), tolerance);
    ASSERT_NEAR(a.internal[i], b.internal[i], tolerance);
    ASSERT_LT(norm(a.stress[i] - b.stress[i]), tolerance * (T(5e6) + norm(b.stress[i])));
    flowed = std::max(flowed, std::abs(a.internal[i] - T(1)));
  }
  EXPECT_GT(flowed, T(0));
}

TEST(MixedMaterials, TilesOfSixteenEqualOneParticleAtATime) {
  check_deformation<float>();
  check_deformation<double>();
}

template <typename T>
void check_run() {
  const auto solver = solver_of<T>(every_model());
  const Diagnostics before = solver->diagnostics();
  double energy = before.kinetic_energy + before.elastic_energy + before.potential_energy;
  for (int f = 0; f < 10; ++f) {
    solver->advance_frame();
    const Diagnostics d = solver->diagnostics();
    const double now = d.kinetic_energy + d.elastic_energy + d.potential_energy;
    EXPECT_LT(now, energy + 2e-3 * before.kinetic_energy);
    energy = now;
    EXPECT_NEAR(d.mass, before.mass, 1e-5 * before.mass);
  }
  EXPECT_LE(solver->statistics().sound_courant, 0.5);
}

TEST(MixedMaterials, ARunOfEveryModelStaysStableAndLosesEnergy) {
  check_run<float>();
  check_run<double>();
}

TEST(MixedMaterials, ARestartedRunEqualsAnUninterruptedOneByteForByte) {
  const Scene scene = every_model();
  const auto whole = solver_of<float>(scene), first = solver_of<float>(scene), second = solver_of<float>(scene);
  for (int f = 0; f < 4; ++f) whole->advance_frame();
  for (int f = 0; f < 2; ++f) first->advance_frame();
  second->load_state(first->save_state());
  for (int f = 0; f < 2; ++f) second->advance_frame();
  EXPECT_TRUE(second->save_state() == whole->save_state());
}

TEST(MixedMaterials, StationaryParticlesKeepTheirPlaceAndHoldWaterUp) {
  Scene scene = scene_with("taichi_stationary", {0.5, 0.5, 0.5}, 0.12);
  scene.sources[0].size = {0.12, 0.05, 0.12};
  add_box(scene, "water", {0.5, 0.56, 0.5}, 0.06);
  scene.time_step.policy = StepPolicy::adaptive;
  const auto solver = solver_of<float>(scene);
  const ParticleFrame start = solver->frame();
  for (int f = 0; f < 6; ++f) solver->advance_frame();
  const ParticleFrame now = solver->frame();
  float lowest = 1;
  for (std::size_t i = 0; i < start.position.size(); ++i) {
    if (solver->particle_type()[i] == particle_type_of(MaterialModel::stationary)) {
      ASSERT_EQ(now.position[i], start.position[i]);
      ASSERT_EQ(now.velocity[i], (Vec3f{0, 0, 0}));
    } else {
      lowest = std::min(lowest, now.position[i][1]);
    }
  }
  EXPECT_GT(lowest, 0.5f);  // free fall would have carried it to 0.48
}

TEST(MixedMaterials, AdaptiveStepHoldsVeryViscousWaterStable) {
  Scene scene = scene_with("honey", {0.5, 0.12, 0.5}, 0.1);
  scene.materials["honey"].viscosity = 1000;
  scene.sources[0].velocity = {1, -1, 0};
  scene.time_step.policy = StepPolicy::adaptive;
  scene.frame_time = 2e-3;
  const auto solver = solver_of<float>(scene);
  const double dx = scene.domain.dx, nu = 1000.0 / 1400;
  double speed = solver->speeds().speed;
  for (int f = 0; f < 5; ++f) {
    solver->advance_frame();
    EXPECT_LE(solver->statistics().last_step, dx * dx / (6 * nu));
    EXPECT_LT(solver->speeds().speed, speed * 1.05);
    speed = solver->speeds().speed;
  }
}

}  // namespace
}  // namespace graupel::mpm
