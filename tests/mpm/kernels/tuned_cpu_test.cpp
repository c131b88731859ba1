// The tuned CPU phases against their portable twins, on every instruction set that this processor runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "core/system/error.h"
#include "mpm/cpu/tuned_phases.h"
#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <typename T>
using SolverPointer = std::unique_ptr<Solver<T>>;

/// After `frames` of a run with the portable kernels: the same state for every test of them.
template <typename T>
SolverPointer<T> state_of(const Scene& scene, int frames) {
  auto solver = std::make_unique<Solver<T>>(scene, SimulationOptions{.kernels = Kernels::portable},
                                            sample_sources(scene, 1), sparsegrid::ObstacleSet(scene));
  for (int i = 0; i < frames; ++i) solver->advance_frame();
  solver->sort_particles();
  return solver;
}

/// Taichi Elements' four materials as they meet the floor and each other.
Scene four_materials() {
  Scene scene = scene_with("taichi_water", {0.4, 0.1, 0.4});
  add_box(scene, "taichi_sand", {0.45, 0.19, 0.42});
  add_box(scene, "taichi_snow", {0.52, 0.11, 0.43});
  add_box(scene, "taichi_jelly", {0.44, 0.12, 0.5});
  for (Source& source : scene.sources) source.velocity = {0.3, -2, 0.1};
  return scene;
}

Scene with_ball(Scene scene) {
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.05;
  ball.position = {0.46, 0.08, 0.44};
  ball.friction = 0.2;
  for (Source& source : scene.sources) source.position[1] += 0.08;
  scene.obstacles.push_back(ball);
  return scene;
}

/// Variants of the laws that the presets leave out.
Scene variants() {
  Scene scene = scene_with("tait_water", {0.4, 0.1, 0.4});
  add_box(scene, "sand", {0.45, 0.19, 0.42});
  add_box(scene, "wet_sand", {0.5, 0.19, 0.5});
  add_box(scene, "snow", {0.52, 0.11, 0.43});
  add_box(scene, "honey", {0.44, 0.12, 0.5});
  scene.materials["sand"].volume_correction = VolumeCorrection::taichi;
  scene.materials["wet_sand"].volume_correction = VolumeCorrection::none;
  scene.materials["snow"].hardening_update = HardeningUpdate::before;
  for (Source& source : scene.sources) source.velocity = {0.3, -2, 0.1};
  scene.frame_time = 4e-3;
  scene.time_step.policy = StepPolicy::adaptive;
  return scene;
}

/// A plastic law may decide differently for a state within rounding of its yield surface, and contact for a light node
/// that hardly moves against the surface; with f32 a few particles see that.
template <typename T>
int64_t allowed_outliers(std::size_t particles) {
  return sizeof(T) == 4 ? static_cast<int64_t>(particles / 1000) : 0;
}

/// Compares particle by particle; stress against the stiffest particle's.
template <typename T>
void expect_close(const HostParticles<T>& a, const HostParticles<T>& b, double tolerance) {
  T stiffest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) stiffest = std::max(stiffest, norm(b.stress[i]));
  int64_t outliers = 0;
  double worst_motion = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const T motion = std::max({norm(a.position[i] - b.position[i]), norm(a.velocity[i] - b.velocity[i]),
                               largest_entry(a.affine_velocity[i] - b.affine_velocity[i]) / 1000});
    const T material =
        std::max({largest_entry(a.deformation_gradient[i] - b.deformation_gradient[i]),
                  norm(a.stress[i] - b.stress[i]) / stiffest / 20, std::abs(a.internal[i] - b.internal[i])});
    worst_motion = std::max(worst_motion, static_cast<double>(motion));
    outliers += static_cast<double>(std::max(material, motion)) < tolerance ? 0 : 1;
  }
  EXPECT_LT(worst_motion, (sizeof(T) == 4 ? 10 : 1) * tolerance);
  EXPECT_LE(outliers, allowed_outliers<T>(a.size()));
}

void expect_same_survey(const StepStatistics& a, const StepStatistics& b, double tolerance) {
  EXPECT_NEAR(a.largest_speed2, b.largest_speed2, tolerance * b.largest_speed2);
  EXPECT_NEAR(a.largest_sound_speed, b.largest_sound_speed, tolerance * b.largest_sound_speed);
  EXPECT_EQ(a.over_courant, b.over_courant);
  EXPECT_EQ(a.bad_slot, b.bad_slot);
  EXPECT_EQ(a.pushed_out, b.pushed_out);
}

template <typename T>
constexpr T step_of_tests = T(3e-4);

/// One substep by the portable phases, of which `parts` says how much.
template <typename T>
StepStatistics portable_substep(Solver<T>& solver, AdvanceParts parts, Buffer<StepStatistics>& records) {
  const SolverView<T> view = solver.view();
  particle_to_grid_by_nodes(view, step_of_tests<T>);
  update_grid(view, step_of_tests<T>);
  grid_to_particle_by_particles(view);
  if (parts != AdvanceParts::gather) update_deformation_portable(view, step_of_tests<T>);
  return parts == AdvanceParts::all ? move_particles(view, step_of_tests<T>, records) : StepStatistics{};
}

template <typename T>
void check_substep(Solver<T>& solver, const std::vector<std::byte>& start, AdvanceParts parts, double condition = 1) {
  const double tolerance = condition * (sizeof(T) == 4 ? 3e-5 : 1e-12);
  const auto restore = [&] {
    solver.load_state(start);
    solver.sort_particles();
    return solver.view();
  };
  Buffer<StepStatistics> records(Device::cpu, 0);
  SolverView<T> view = restore();
  const StepStatistics expected = portable_substep(solver, parts, records);
  const HostParticles<T> particles = solver.particles();
  const std::vector<int32_t> keys(view.keys, view.keys + view.particles.count);
  for (const InstructionSet set : available_instruction_sets()) {
    SCOPED_TRACE(name_of(set));
    view = restore();
    particle_to_grid_tuned(view, step_of_tests<T>, set, GridParts::velocities);
    const StepStatistics found = advance_tuned(view, step_of_tests<T>, parts, records, set);
    expect_close(solver.particles(), particles, tolerance);
    if (parts != AdvanceParts::all) continue;
    expect_same_survey(found, expected, sizeof(T) == 4 ? 1e-4 : 1e-11);
    int64_t elsewhere = 0;
    for (std::size_t i = 0; i < keys.size(); ++i) elsewhere += view.keys[i] != keys[i] ? 1 : 0;
    EXPECT_LE(elsewhere, allowed_outliers<T>(keys.size()));
  }
}

template <typename T>
void check_scene(const Scene& scene, int frames) {
  const SolverPointer<T> solver = state_of<T>(scene, frames);
  const std::vector<std::byte> start = solver->save_state();
  for (const AdvanceParts parts : {AdvanceParts::gather, AdvanceParts::gather_and_deform, AdvanceParts::all})
    check_substep(*solver, start, parts);
}

TEST(TunedCpu, ASubstepEqualsThePortableOne) {
  check_scene<float>(four_materials(), 2);
  check_scene<double>(four_materials(), 2);
}

TEST(TunedCpu, ASubstepAmongObstaclesEqualsThePortableOne) {
  check_scene<float>(with_ball(four_materials()), 3);
  check_scene<double>(with_ball(four_materials()), 3);
}

TEST(TunedCpu, EveryVariantOfTheLawsEqualsThePortableOne) {
  check_scene<float>(variants(), 8);
  check_scene<double>(variants(), 8);
}

TEST(TunedCpu, OtherModelsAndStationaryParticlesTakeTheGeneralWay) {
  check_scene<float>(every_model(), 6);
  check_scene<double>(every_model(), 6);
}

constexpr double flatness = 0.01;

/// Turns the deformation of every 40th particle inside out, or flattens it.
template <typename T>
void damage(const SolverView<T>& view) {
  for (int64_t slot = 0; slot < view.particles.count; slot += 40) {
    Mat<T, 3> F = load_matrix<T, 3>(view.particles.deformation_gradient, slot);
    for (int c = 0; c < 3; ++c) F(1, c) *= slot % 80 == 0 ? T(-1) : T(flatness);
    store_matrix<T, 3>(view.particles.deformation_gradient, slot, F);
  }
}

template <typename T>
void check_damaged(const char* material) {
  const SolverPointer<T> solver = state_of<T>(scene_with(material, {0.4, 0.1, 0.4}), 1);
  damage(solver->view());
  check_substep(*solver, solver->save_state(), AdvanceParts::gather_and_deform, 1 / flatness);
}

TEST(TunedCpu, InvertedAndFlatParticlesTakeTheGeneralWay) {
  for (const char* material : {"taichi_sand", "taichi_snow"}) {
    check_damaged<float>(material);
    check_damaged<double>(material);
  }
}

TEST(TunedCpu, BadParticlesAreFoundWhereTheyAre) {
  for (const InstructionSet set : available_instruction_sets()) {
    SCOPED_TRACE(name_of(set));
    for (const int64_t slot : {int64_t{0}, int64_t{517}}) {
      const SolverPointer<float> solver = state_of<float>(scene_with("taichi_water", {0.4, 0.1, 0.4}), 1);
      const SolverView<float> view = solver->view();
      particle_to_grid_tuned(view, step_of_tests<float>, set, GridParts::velocities);
      view.particles.internal.set(slot, -1.0F);
      Buffer<StepStatistics> records(Device::cpu, 0);
      const StepStatistics found = advance_tuned(view, step_of_tests<float>, AdvanceParts::all, records, set);
      EXPECT_EQ(found.bad_slot, slot);
    }
  }
}

/// A whole run with the tuned kernels stays near one with the portable ones; every scripted thing that they leave to
/// the general code is in one of these scenes.
void check_run(const Scene& scene, int frames) {
  const auto portable = Simulation::create(scene, {.precision = Precision::f64, .kernels = Kernels::portable});
  for (int f = 0; f < frames; ++f) portable->advance_frame();
  const Diagnostics expected = portable->diagnostics();
  const ParticleFrame b = portable->frame();
  for (const InstructionSet set : available_instruction_sets()) {
    SCOPED_TRACE(name_of(set));
    const auto tuned = Simulation::create(scene, {.precision = Precision::f64, .instruction_set = set});
    for (int f = 0; f < frames; ++f) tuned->advance_frame();
    const ParticleFrame a = tuned->frame();
    EXPECT_EQ(a.active, b.active);
    float worst = 0;
    for (std::size_t i = 0; i < a.position.size(); ++i) worst = std::max(worst, norm(a.position[i] - b.position[i]));
    EXPECT_LT(worst, 1e-5F);
    EXPECT_NEAR(tuned->diagnostics().kinetic_energy, expected.kinetic_energy, 1e-6 * expected.kinetic_energy);
    EXPECT_EQ(tuned->statistics().substeps, portable->statistics().substeps);
    EXPECT_EQ(tuned->statistics().born, portable->statistics().born);
    EXPECT_EQ(tuned->statistics().removed, portable->statistics().removed);
  }
}

Scene jelly_in_motion() {
  Scene scene = scene_with("jelly");
  scene.sources[0].velocity = {1, -1, 0.5};
  scene.frame_time = 4e-3;
  return scene;
}

TEST(TunedCpu, RunsWithEmittersAndSinksEqualPortableOnes) {
  Scene scene = jelly_in_motion();
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.1, 0.02, 0.08};
  emitter.position = {0.5, 0.7, 0.5};
  emitter.material = "jelly";
  emitter.velocity = {0, -2, 0};
  emitter.end_time = 0.03;
  scene.emitters.push_back(emitter);
  scene.domain.faces.x_high = WallConfig{.kind = Wall::open, .friction = {}};
  scene.sources[0].position = {0.9, 0.4, 0.5};
  check_run(scene, 6);
}

TEST(TunedCpu, RunsWithLedParticlesEqualPortableOnes) {
  Scene scene = jelly_in_motion();
  KinematicRegion region;
  region.shape = RegionShape::half_space;
  region.position = {0.48, 0.5, 0.5};
  region.normal = {1, 0, 0};
  region.motion.velocity = {0.3, 0, 0};
  scene.kinematic_regions = {region};
  check_run(scene, 6);
}

TEST(TunedCpu, RunsWithMovingObstaclesAndPeriodicWallsEqualPortableOnes) {
  Scene scene = jelly_in_motion();
  Obstacle paddle;
  paddle.size = {0.02, 0.2, 0.2};
  paddle.position = {0.57, 0.5, 0.5};
  paddle.motion = Motion{};
  paddle.motion->velocity = {-1, 0, 0};
  scene.obstacles.push_back(paddle);
  const WallConfig wall{.kind = Wall::periodic, .friction = {}};
  scene.domain.faces.z_low = scene.domain.faces.z_high = wall;
  check_run(scene, 6);
}

TEST(TunedCpu, RunsWithDampedAndWithPicTransfersEqualPortableOnes) {
  Scene scene = jelly_in_motion();
  scene.transfer.damping = 3;
  check_run(scene, 4);
  scene.transfer.damping = 0;
  scene.transfer.scheme = TransferScheme::pic;
  check_run(scene, 4);
}

TEST(TunedCpu, EveryInstructionSetContinuesItsOwnStatesByteForByteAndRefusesOthers) {
  const Scene scene = four_materials();
  for (const InstructionSet set : available_instruction_sets()) {
    const SimulationOptions options{.instruction_set = set};
    const auto whole = Simulation::create(scene, options), first = Simulation::create(scene, options),
               second = Simulation::create(scene, options);
    for (int f = 0; f < 2; ++f) whole->advance_frame();
    first->advance_frame();
    second->load_state(first->save_state());
    second->advance_frame();
    EXPECT_TRUE(second->save_state() == whole->save_state()) << name_of(set);
    for (const InstructionSet other : available_instruction_sets()) {
      if (other == set) continue;
      const auto foreign = Simulation::create(scene, {.instruction_set = other});
      try {
        foreign->load_state(first->save_state());
        ADD_FAILURE() << "a state of " << name_of(set) << " was taken by " << name_of(other);
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr(std::string("GRAUPEL_SIMD=") + name_of(set)));
      }
    }
  }
}

TEST(InstructionSets, TheBestIsTakenUnlessOneIsNamed) {
  const std::vector<InstructionSet> available = available_instruction_sets();
  ASSERT_EQ(available.front(), InstructionSet::baseline);
  EXPECT_EQ(choose_instruction_set(""), available.back());
  for (const InstructionSet set : available) EXPECT_EQ(choose_instruction_set(name_of(set)), set);
}

TEST(InstructionSets, UnknownWordsAreRefused) {
  try {
    choose_instruction_set("sse9");
    ADD_FAILURE() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("is not known (sse9, allowed here: baseline"));
  }
}

}  // namespace
}  // namespace graupel::mpm
