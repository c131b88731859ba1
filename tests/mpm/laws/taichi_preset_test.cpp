// The presets named after Taichi Elements (commit 2451c98) against its constants and against a transcription of its
// per-particle update.
#include <gtest/gtest.h>

#include "io/scene/recipe_reader.h"
#include "mpm/materials/material.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

constexpr double mu_0 = 1e6 / (2 * 1.2), lambda_0 = 1e6 * 0.2 / (1.2 * 0.6);  // E = 1e6 * size, nu = 0.2, size = 1

TEST(TaichiPresets, ConstantsAreThoseOfTaichiElements) {
  EXPECT_NEAR(mu_0, 416666.7, 0.1);
  EXPECT_NEAR(lambda_0, 277777.8, 0.1);
  for (const char* name : {"taichi_water", "taichi_jelly", "taichi_snow", "taichi_sand", "taichi_stationary"})
    EXPECT_EQ(preset(name).density, 1000) << name;

  const auto water = material_parameters<double>(preset("taichi_water"));
  EXPECT_NEAR(water.bulk_modulus, lambda_0, 1e-6);
  EXPECT_EQ(water.equation_of_state, EquationOfState::linear);
  EXPECT_EQ(water.viscosity, 0);
  EXPECT_NEAR(water.elastic_speed, 16.67, 5e-3);

  const auto jelly = material_parameters<double>(preset("taichi_jelly"));  // h = 0.3 whatever J_p
  EXPECT_NEAR(jelly.mu, 0.3 * mu_0, 1e-6);
  EXPECT_NEAR(jelly.lambda, 0.3 * lambda_0, 1e-6);

  const auto snow = material_parameters<double>(preset("taichi_snow"));
  EXPECT_NEAR(snow.mu, mu_0, 1e-6);
  EXPECT_NEAR(snow.lambda, lambda_0, 1e-6);
  EXPECT_EQ(snow.critical_compression, 2.5e-2);
  EXPECT_EQ(snow.critical_stretch, 4.5e-3);
  EXPECT_EQ(snow.hardening, 10);
  EXPECT_EQ(snow.max_hardening, 0);  // no cap
  EXPECT_EQ(snow.hardening_update, HardeningUpdate::before);
  EXPECT_EQ(initial_internal_variable(snow.model), 1);

  const auto sand = material_parameters<double>(preset("taichi_sand"));
  EXPECT_NEAR(sand.mu, mu_0, 1e-6);
  EXPECT_NEAR(sand.lambda, lambda_0, 1e-6);
  EXPECT_NEAR(sand.friction, 0.5036, 1e-4);  // 45 degrees
  EXPECT_EQ(sand.cohesion_length, 0);
  EXPECT_EQ(sand.tension_limit, 0);
  EXPECT_EQ(sand.volume_correction, VolumeCorrection::taichi);
  EXPECT_EQ(initial_internal_variable(sand.model), 0);
}

/// default_dt = 2e-2 dx / size; a frame of 1/60 s takes int(frame / default_dt) + 1 equal substeps.
TEST(TaichiPresets, RecipeHasItsGridStepGravityAndWalls) {
  const SceneRecipe recipe = io::read_recipe(std::string(GRAUPEL_SOURCE_DIR) + "/scenes/recipes/hgn.json");
  const double dx = recipe.domain.dx;
  EXPECT_EQ(dx, 1.0 / 64);
  EXPECT_EQ(recipe.frame_time, 1.0 / 60);
  const auto substeps = static_cast<int64_t>((1.0 / 60) / (2e-2 * dx)) + 1;
  EXPECT_EQ(substeps, 54);
  EXPECT_EQ(recipe.time_step.policy, StepPolicy::fixed);
  EXPECT_EQ(recipe.time_step.substeps_per_frame, substeps);
  const double dt = recipe.frame_time / static_cast<double>(substeps);
  EXPECT_NEAR(dt, 3.0864e-4, 1e-8);
  EXPECT_EQ(recipe.gravity, (Vec3d{0, -9.8, 0}));
  EXPECT_EQ(recipe.domain.walls, Contact::separate);
  EXPECT_EQ(recipe.domain.wall_friction, 0);
  EXPECT_EQ(recipe.domain.wall_cells, 3);
  EXPECT_EQ(recipe.groups.particles_per_cell, 8);
  // Sound CFL 0.33 of water, 0.36 of jelly, 0.66 of snow and sand, 1.08 of snow at J_p = 0.9.
  const auto courant = [&](const char* name, double internal) {
    return sound_speed(material_parameters<double>(preset(name)), Mat3d::identity(), internal) * dt / dx;
  };
  EXPECT_NEAR(courant("taichi_water", 1), 0.33, 5e-3);
  EXPECT_NEAR(courant("taichi_jelly", 1), 0.36, 5e-3);
  EXPECT_NEAR(courant("taichi_snow", 1), 0.66, 5e-3);
  EXPECT_NEAR(courant("taichi_sand", 0), 0.66, 5e-3);
  EXPECT_NEAR(courant("taichi_snow", 0.9), 1.08, 1e-2);
}

enum class TaichiMaterial { water, elastic, snow, sand };

/// sand_projection: the trace counts Jp, the strains do not.
Vec3d taichi_sand_projection(const Vec3d& sigma, double& Jp) {
  const double sine = std::sin(45 * 3.14159265358979323846 / 180), alpha = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine);
  Vec3d epsilon;
  for (int i = 0; i < 3; ++i) epsilon[i] = std::log(std::max(std::abs(sigma[i]), 1e-4));
  const double tr = epsilon[0] + epsilon[1] + epsilon[2] + Jp;
  if (tr >= 0) {
    Jp = tr;
    return {1, 1, 1};
  }
  Jp = 0;
  const Vec3d hat = epsilon - Vec3d::filled(tr / 3);
  const double length = norm(hat) + 1e-20;
  const double delta = length + (3 * lambda_0 + 2 * mu_0) / (2 * mu_0) * tr * alpha;
  Vec3d out;
  for (int i = 0; i < 3; ++i) out[i] = std::exp(epsilon[i] - std::max(0.0, delta) / length * hat[i]);
  return out;
}

/// The particle part of its substep, in its order; returns the Kirchhoff stress.
Mat3d taichi_update(TaichiMaterial material, double dt, const Mat3d& C, Mat3d& F, double& Jp) {
  F = (Mat3d::identity() + dt * C) * F;
  double h = 1;
  if (material != TaichiMaterial::water) h = std::exp(10 * (1 - Jp));
  if (material == TaichiMaterial::elastic) h = 0.3;
  const double mu = material == TaichiMaterial::water ? 0 : mu_0 * h, la = lambda_0 * h;
  Svd<double, 3> d = svd(F);
  if (material == TaichiMaterial::sand) {
    const Vec3d sigma = taichi_sand_projection(d.sigma, Jp);
    F = d.U * Mat3d::diagonal(sigma) * transpose(d.V);
    double log_sum = 0;
    for (int i = 0; i < 3; ++i) log_sum += std::log(sigma[i]);
    Vec3d center;
    for (int i = 0; i < 3; ++i) center[i] = 2 * mu_0 * std::log(sigma[i]) + lambda_0 * log_sum;
    return d.U * Mat3d::diagonal(center) * transpose(d.U);
  }
  double J = 1;
  for (int i = 0; i < 3; ++i) {
    double kept = d.sigma[i];
    if (material == TaichiMaterial::snow) kept = std::min(std::max(kept, 1 - 2.5e-2), 1 + 4.5e-3);
    Jp *= d.sigma[i] / kept;
    d.sigma[i] = kept;
    J *= kept;
  }
  if (material == TaichiMaterial::water) {
    F = Mat3d::diagonal({J, 1, 1});
    Jp = J;
  } else if (material == TaichiMaterial::snow) {
    F = d.U * Mat3d::diagonal(d.sigma) * transpose(d.V);
  }
  return 2 * mu * ((F - d.U * transpose(d.V)) * transpose(F)) + la * J * (J - 1) * Mat3d::identity();
}

TEST(TaichiPresets, TwoHundredStepsEqualTheTranscription) {
  const std::pair<const char*, TaichiMaterial> all[] = {{"taichi_water", TaichiMaterial::water},
                                                        {"taichi_jelly", TaichiMaterial::elastic},
                                                        {"taichi_snow", TaichiMaterial::snow},
                                                        {"taichi_sand", TaichiMaterial::sand}};
  const double dt = 1.0 / 60 / 54;
  for (const auto& [name, material] : all) {
    const auto m = material_parameters<double>(preset(name));
    Mat3d F = Mat3d::identity(), theirs = Mat3d::identity();
    double internal = initial_internal_variable(m.model), Jp = internal;
    for (uint64_t i = 0; i < 200; ++i) {
      const Mat3d C = random_matrix<double, 3>(i, i % 7 == 0 ? 60 : 15);
      const Mat3d tau = update_material(m, dt, C, F, internal), expected = taichi_update(material, dt, C, theirs, Jp);
      ASSERT_LT(largest_entry(tau - expected), 1e-8 * (largest_entry(expected) + mu_0)) << name << " step " << i;
      if (material != TaichiMaterial::elastic) {  // there internal is J, and Jp stays 1
        ASSERT_NEAR(internal, Jp, 1e-10) << name << " step " << i;
      }
    }
  }
}

}  // namespace
}  // namespace graupel::mpm
