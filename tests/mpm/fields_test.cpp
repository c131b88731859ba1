// Stress, affine velocity, deformation and plastic state as trajectories store them: known states, the sources' order.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mpm/materials/material.h"
#include "mpm/solver/solver.h"
#include "tests/mpm/kernels/fiber_backend.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

const FieldSet all_fields = {ParticleField::stress, ParticleField::affine, ParticleField::deformation_gradient,
                             ParticleField::plastic};

template <typename T>
Solver<T> solver_of(const Scene& scene) {
  return Solver<T>(scene, {.precision = sizeof(T) == 8 ? Precision::f64 : Precision::f32}, sample_sources(scene, 1),
                   sparsegrid::ObstacleSet(scene));
}

template <typename T>
class Fields : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Fields, Scalars);

TYPED_TEST(Fields, UndeformedParticlesHaveNoStressTheIdentityAndTheirModelsStart) {
  const Scene scene = every_model();
  const Solver<TypeParam> solver = solver_of<TypeParam>(scene);
  const ParticleFields fields = solver.fields(all_fields);
  const HostParticles<TypeParam> host = solver.particles();
  const std::size_t n = solver.particle_count();
  ASSERT_EQ(fields[ParticleField::stress].size(), 6 * n);
  ASSERT_EQ(fields[ParticleField::affine].size(), 9 * n);
  ASSERT_EQ(fields[ParticleField::deformation_gradient].size(), 9 * n);
  ASSERT_EQ(fields[ParticleField::plastic].size(), n);
  EXPECT_THAT(fields[ParticleField::stress], testing::Each(0.0f));
  EXPECT_THAT(fields[ParticleField::affine], testing::Each(0.0f));
  for (std::size_t i = 0; i < 9 * n; ++i)
    ASSERT_EQ(fields[ParticleField::deformation_gradient][i], i % 9 % 4 == 0 ? 1.0f : 0.0f) << i;
  EXPECT_THAT(fields[ParticleField::plastic], testing::Contains(0.0f));  // strains
  EXPECT_THAT(fields[ParticleField::plastic], testing::Contains(1.0f));  // volume ratios
}

/// A block that turns as a rigid body: C = W, F = exp(W t), no stress.
TYPED_TEST(Fields, ARotationTurnsTheDeformationGradientAndMakesNoStress) {
  Scene scene = scene_with("jelly");
  scene.gravity = {0, 0, 0};
  const double rate = 4;
  scene.sources[0].angular_velocity = {0, 0, rate};
  scene.sources[0].sampling = Sampling::jittered_lattice;
  scene.frame_time = 0.01;
  scene.time_step.policy = StepPolicy::adaptive;
  Solver<TypeParam> solver = solver_of<TypeParam>(scene);
  const ParticleFields start = solver.fields(all_fields);
  for (std::size_t i = 0; i < solver.particle_count(); ++i) {
    ASSERT_EQ(start[ParticleField::affine][9 * i + 1], static_cast<float>(-rate));
    ASSERT_EQ(start[ParticleField::affine][9 * i + 3], static_cast<float>(rate));
    ASSERT_EQ(start[ParticleField::affine][9 * i + 8], 0.0f);
  }
  solver.advance_frame();
  const ParticleFields fields = solver.fields(all_fields);
  const double angle = rate * scene.frame_time, modulus = scene.materials.at("jelly").youngs_modulus;
  const double F[] = {std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  for (std::size_t i = 0; i < solver.particle_count(); ++i) {
    for (std::size_t k = 0; k < 9; ++k)
      ASSERT_NEAR(static_cast<double>(fields[ParticleField::deformation_gradient][9 * i + k]), F[k], 2e-3) << k;
    for (std::size_t k = 0; k < 6; ++k)
      ASSERT_LT(std::abs(static_cast<double>(fields[ParticleField::stress][6 * i + k])), 2e-3 * modulus) << k;
    ASSERT_NEAR(static_cast<double>(fields[ParticleField::affine][9 * i + 3]), rate, 0.1 * rate);
  }
}

/// Fixed corotated, F = diag(a, b, 1): tau = 2 mu (F - R) F^T + lambda J (J - 1) I with R = I. Another particle's six
/// known components show where each is put.
TYPED_TEST(Fields, AUniformStretchHasTheStressOfTheLaw) {
  using T = TypeParam;
  const MaterialConfig config = preset("taichi_jelly");
  const auto m = material_parameters<T>(config);
  const T a = T(1.1), b = T(0.95);
  HostParticles<T> particles(3);
  for (std::size_t i = 0; i < 3; ++i) {
    Mat<T, 3> F = Mat<T, 3>::diagonal({a, b, T(1)});
    T internal = 1;
    const Mat<T, 3> tau = update_material(m, T(0), Mat<T, 3>::zero(), F, internal);
    particles.stress[i] = {tau(0, 0), tau(1, 1), tau(2, 2), tau(0, 1), tau(0, 2), tau(1, 2)};
    particles.deformation_gradient[i] = F;
    particles.internal[i] = internal;
    particles.source_index[i] = static_cast<int32_t>(2 - i);
  }
  particles.stress[0] = {1, 2, 3, 4, 5, 6};  // xx, yy, zz, xy, xz, yz
  const ParticleFields fields = fields_of(particles, {ParticleField::stress, ParticleField::plastic});
  EXPECT_TRUE(fields[ParticleField::affine].empty());
  const double J = static_cast<double>(a) * static_cast<double>(b),
               volumetric = static_cast<double>(m.lambda) * J * (J - 1);
  const auto along = [&](T s) { return 2 * static_cast<double>(m.mu) * static_cast<double>((s - 1) * s) + volumetric; };
  const double expected[] = {along(a), 0, 0, along(b), 0, volumetric};  // xx, xy, xz, yy, yz, zz
  for (std::size_t k = 0; k < 6; ++k)
    EXPECT_NEAR(static_cast<double>(fields[ParticleField::stress][k]), expected[k], 1e-4 * std::abs(expected[0])) << k;
  EXPECT_NEAR(static_cast<double>(fields[ParticleField::plastic][0]), J, 1e-6);
  const float known[] = {1, 4, 5, 2, 6, 3};
  for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(fields[ParticleField::stress][12 + k], known[k]);
}

TYPED_TEST(Fields, AreInTheOrderOfTheSourcesWhateverTheSolversOwn) {
  Scene scene = every_model();
  Solver<TypeParam> solver = solver_of<TypeParam>(scene);
  for (int f = 0; f < 3; ++f) solver.advance_frame();
  const ParticleFields fields = solver.fields(all_fields);
  const HostParticles<TypeParam> host = solver.particles();
  bool moved = false;
  for (std::size_t slot = 0; slot < host.size(); ++slot) {
    const auto i = static_cast<std::size_t>(host.source_index[slot]);
    moved = moved || i != slot;
    ASSERT_EQ(fields[ParticleField::plastic][i], static_cast<float>(host.internal[slot]));
    ASSERT_EQ(fields[ParticleField::stress][6 * i + 3], static_cast<float>(host.stress[slot][1]));
    ASSERT_EQ(fields[ParticleField::affine][9 * i + 5], static_cast<float>(host.affine_velocity[slot](1, 2)));
    ASSERT_EQ(fields[ParticleField::deformation_gradient][9 * i + 6],
              static_cast<float>(host.deformation_gradient[slot](2, 0)));
  }
  EXPECT_TRUE(moved);
}

TYPED_TEST(Fields, ParticlesThatAreNotInTheRunHaveNoStressAndNoAffineVelocity) {
  Scene scene = scene_with("taichi_jelly", {0.5, 0.12, 0.5});
  scene.sources[0].velocity = {0, -2, 0};
  scene.frame_time = 0.01;
  scene.time_step.policy = StepPolicy::adaptive;
  Sink sink;
  sink.position = {0.5, 0.08, 0.5};
  sink.size = {1, 0.03, 1};
  scene.sinks.push_back(sink);
  Solver<TypeParam> solver = solver_of<TypeParam>(scene);
  solver.advance_frame();
  const std::vector<uint8_t> active = solver.frame().active;
  const ParticleFields fields = solver.fields(all_fields);
  ASSERT_GT(solver.statistics().removed, 0);
  ASSERT_LT(static_cast<std::size_t>(solver.statistics().removed), active.size());
  double stress_in_run = 0;
  for (std::size_t i = 0; i < active.size(); ++i)
    for (std::size_t k = 0; k < 6; ++k) {
      const float value = fields[ParticleField::stress][6 * i + k];
      if (active[i] == 0) {
        ASSERT_EQ(value, 0.0f);
      }
      stress_in_run += std::abs(static_cast<double>(value));
    }
  EXPECT_GT(stress_in_run, 0);
}

TEST(FieldsOfTheGpuSolver, EqualThoseOfTheCpu) {
  Scene scene = scene_with("taichi_jelly", {0.5, 0.12, 0.5}, 0.06);
  scene.sources[0].angular_velocity = {0, 0, 3};
  scene.time_step.substeps_per_frame = 10;
  scene.frame_time = 10 * 3e-4;
  Solver<float> cpu = solver_of<float>(scene);
  FiberBackend backend;
  std::vector<BatchEntry> entries;
  entries.push_back({scene, sample_sources(scene, 1), sparsegrid::ObstacleSet(scene)});
  BatchSolver<FiberBackend> batch(backend, std::move(entries));
  cpu.advance_frame();
  batch.advance_frame();
  const ParticleFields a = cpu.fields(all_fields), b = fields_of(batch.particles(), all_fields);
  const double scale[] = {0.01 * scene.materials.at("taichi_jelly").youngs_modulus, 0.05, 1e-4, 1e-4};
  for (const ParticleField field : all_particle_fields) {
    ASSERT_EQ(a[field].size(), b[field].size());
    double worst = 0;
    for (std::size_t i = 0; i < a[field].size(); ++i)
      worst = std::max(worst, std::abs(static_cast<double>(a[field][i] - b[field][i])));
    EXPECT_LT(worst, scale[static_cast<std::size_t>(field)]) << info_of(field).name;
  }
}

TEST(FrameWithFields, AsksForTheSelectedOnesAlone) {
  const auto run = Simulation::create(scene_with("taichi_water"), {});
  EXPECT_EQ(frame_with_fields(*run, {}).fields, ParticleFields{});
  const ParticleFrame frame = frame_with_fields(*run, {ParticleField::plastic});
  EXPECT_EQ(frame.fields[ParticleField::plastic], std::vector<float>(run->particle_count(), 1.0f));
  EXPECT_TRUE(frame.fields[ParticleField::stress].empty());
}

}  // namespace
}  // namespace graupel::mpm
