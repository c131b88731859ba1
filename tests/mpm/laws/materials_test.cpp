// Laws that every material obeys: objectivity, symmetry, stress as the derivative of the energy, idempotent return
// maps.
#include "mpm/materials/material.h"

#include <gtest/gtest.h>

#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <int D>
Mat<double, D> some_rotation() {
  if constexpr (D == 3)
    return rotation_about(normalized(Vec3d{1, -2, 0.5}), 0.8);
  else
    return Mat<double, 2>{{{std::cos(0.8), -std::sin(0.8)}, {std::sin(0.8), std::cos(0.8)}}};
}

/// Kirchhoff stress of an elastic state (no plastic flow happens for the small F used here).
template <int D>
Mat<double, D> stress_at(const MaterialParameters<double>& m, Mat<double, D> F, double internal) {
  return map_and_stress(m, 1e-4, needs_svd(m.model) ? svd(F) : Svd<double, D>{}, F, internal);
}

/// An elastic state: inside the yield surface of every material.
template <int D>
Mat<double, D> elastic_state(uint64_t i) {
  return 0.995 * Mat<double, D>::identity() + random_matrix<double, D>(i, 2e-4);
}

constexpr const char* solids[] = {"jelly", "snow", "sand", "taichi_jelly", "taichi_snow", "taichi_sand"};

template <int D>
void check_objectivity_and_symmetry() {
  for (const char* name : solids) {
    const auto m = material_parameters<double>(preset(name));
    const double internal = initial_internal_variable(m.model);
    const Mat<double, D> R = some_rotation<D>();
    for (uint64_t i = 0; i < 20; ++i) {
      const Mat<double, D> F = elastic_state<D>(i), tau = stress_at(m, F, internal);
      const double scale = largest_entry(tau);
      EXPECT_LT(largest_entry(stress_at(m, R * F, internal) - R * tau * transpose(R)), 1e-9 * scale) << name;
      EXPECT_LT(largest_entry(stress_at(m, F * R, internal) - tau), 1e-9 * scale) << name << ": isotropy";
      EXPECT_LT(largest_entry(tau - transpose(tau)), 1e-12 * scale) << name;
    }
  }
}

TEST(Materials, StressTurnsWithTheFrameAndIsSymmetric) {
  check_objectivity_and_symmetry<2>();
  check_objectivity_and_symmetry<3>();
}

template <int D>
void check_energy_derivative() {
  const double h = 1e-6;
  for (const char* name : solids) {
    const auto m = material_parameters<double>(preset(name));
    const double internal = initial_internal_variable(m.model);
    const Mat<double, D> F = elastic_state<D>(3), tau = stress_at(m, F, internal);
    Mat<double, D> P_times_F = Mat<double, D>::zero();
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) {
        Mat<double, D> high = F, low = F;
        high(r, c) += h;
        low(r, c) -= h;
        const double P = (energy_density(m, high, internal) - energy_density(m, low, internal)) / (2 * h);
        for (int k = 0; k < D; ++k) P_times_F(r, k) += P * F(k, c);
      }
    EXPECT_LT(largest_entry(P_times_F - tau), 1e-5 * largest_entry(tau)) << name;
  }
}

TEST(Materials, StressIsTheDerivativeOfTheEnergy) {
  check_energy_derivative<2>();
  check_energy_derivative<3>();
}

TEST(Materials, WaterStressIsTheDerivativeOfItsEnergy) {
  const auto m = material_parameters<double>(preset("taichi_water"));
  const double J = 0.97, h = 1e-6;
  const double derivative = (water_energy(m, J + h) - water_energy(m, J - h)) / (2 * h);
  EXPECT_NEAR(water_stress(m, J), J * derivative, 1e-3);
  EXPECT_NEAR(water_sound_speed(m, 1.0), std::sqrt(277777.78 / 1000), 1e-3);  // 16.67 m/s
}

TEST(Materials, WaterKeepsOnlyTheVolumeRatio) {
  const auto m = material_parameters<double>(preset("water"));
  Mat3d F = Mat3d::identity();
  double J = 0.9;
  const Mat3d C = random_matrix<double, 3>(4, 10);
  update_material(m, 1e-3, C, F, J);
  EXPECT_NEAR(J, 0.9 * determinant(Mat3d::identity() + 1e-3 * C), 1e-14);
  EXPECT_EQ(largest_entry(F - Mat3d::identity()), 0);
}

TEST(Materials, CorotatedStressIsTheFormula) {
  const auto m = material_parameters<double>(preset("jelly"));
  const Mat3d F = Mat3d::identity() + random_matrix<double, 3>(5, 0.2);
  const double J = determinant(F);
  const auto d = svd(F);
  const Mat3d R = d.U * transpose(d.V);  // of the polar decomposition F = R S
  const Mat3d expected = 2.0 * m.mu * ((F - R) * transpose(F)) + m.lambda * J * (J - 1) * Mat3d::identity();
  EXPECT_LT(largest_entry(stress_at(m, F, 1) - expected), 1e-9 * largest_entry(expected));
}

TEST(Snow, SingularValuesStayInTheirRangeAndJpTakesWhatWasCut) {
  const auto m = material_parameters<double>(preset("taichi_snow"));
  Vec3d sigma = {1.2, 1.0, 0.7};
  double J_p = 0.95;
  EXPECT_TRUE(snow_return_mapping(m, sigma, J_p));
  EXPECT_DOUBLE_EQ(sigma[0], 1 + 4.5e-3);
  EXPECT_DOUBLE_EQ(sigma[1], 1.0);
  EXPECT_DOUBLE_EQ(sigma[2], 1 - 2.5e-2);
  EXPECT_NEAR(J_p, 0.95 * 1.2 / 1.0045 * 0.7 / 0.975, 1e-14);
  const Vec3d once = sigma;
  const double J_once = J_p;
  EXPECT_FALSE(snow_return_mapping(m, sigma, J_p));
  EXPECT_EQ(sigma, once);
  EXPECT_EQ(J_p, J_once);
}

TEST(Snow, HardeningGrowsWithCompressionAndIsCapped) {
  auto m = material_parameters<double>(preset("taichi_snow"));
  EXPECT_NEAR(snow_hardening(m, 0.9), std::exp(1.0), 1e-14);
  EXPECT_NEAR(snow_hardening(m, 0.0), std::exp(10.0), 1e-9);  // max_hardening 0: no cap
  m.max_hardening = 20;
  EXPECT_EQ(snow_hardening(m, 0.0), 20);
  EXPECT_NEAR(sound_speed(m, Mat3d::identity(), 0.0), std::sqrt(20.0) * m.elastic_speed, 1e-9);
}

TEST(Snow, StressOfAStepUsesTheHardeningBeforeIt) {
  const auto m = material_parameters<double>(preset("taichi_snow"));
  Mat3d F = 0.9 * Mat3d::identity();
  double J_p = 1;
  const Svd<double, 3> d = svd(F);
  const Mat3d tau = map_and_stress(m, 1e-3, d, F, J_p);
  EXPECT_LT(J_p, 1);
  const double s = 0.975, J = s * s * s;
  EXPECT_NEAR(tau(0, 0), 2 * m.mu * (s - 1) * s + m.lambda * J * (J - 1), 1e-6);  // h = 1
}

TEST(Sand, ReturnMappingIsIdempotent) {
  const Vec3d states[] = {{0.1, 0.02, -0.05}, {-0.01, -0.03, -0.2}, {-0.1, -0.1, -0.1}, {0.2, -0.1, -0.3}};
  for (const char* name : {"sand", "taichi_sand"})
    for (const Vec3d& state : states) {
      const auto m = material_parameters<double>(preset(name));
      Vec3d strain = state;
      double v_c = 0;
      sand_return_mapping(m, strain, v_c);
      Vec3d again = strain;
      double v_again = v_c;
      sand_return_mapping(m, again, v_again);
      EXPECT_LT(norm(again - strain), 1e-15);
      EXPECT_NEAR(v_again, v_c, 1e-15);
    }
}

TEST(Sand, StressIsOnTheConeAfterShearAndZeroAfterTension) {
  const auto m = material_parameters<double>(preset("sand"));
  Vec3d strain = {0.1, -0.05, -0.2};
  double v_c = 0;
  EXPECT_TRUE(sand_return_mapping(m, strain, v_c));
  const double sum = strain[0] + strain[1] + strain[2];
  EXPECT_NEAR(sum, -0.15, 1e-15);  // shear flow keeps the volume
  const Vec3d deviator = strain - Vec3d::filled(sum / 3);
  EXPECT_NEAR(norm(deviator), -(3 * m.lambda + 2 * m.mu) / (2 * m.mu) * sum * m.friction, 1e-14);
  strain = {0.1, 0.02, 0.01};
  sand_return_mapping(m, strain, v_c);
  EXPECT_EQ(norm(strain), 0);
  EXPECT_NEAR(v_c, 0.13, 1e-15);
}

/// Sand stretched by 10% and closed again carries no stress until its volume is back: klar and taichi remember, none
/// does not.
TEST(Sand, VolumeCorrectionRemembersTension) {
  for (const VolumeCorrection kind : {VolumeCorrection::klar, VolumeCorrection::taichi, VolumeCorrection::none}) {
    MaterialConfig config = preset("sand");
    config.volume_correction = kind;
    const auto m = material_parameters<double>(config);
    Mat3d F = 1.1 * Mat3d::identity();
    double v_c = 0;
    map_and_stress(m, 1e-3, svd(F), F, v_c);
    F = (1 / 1.05) * F;  // still larger than at the start
    const Mat3d tau = map_and_stress(m, 1e-3, svd(F), F, v_c);
    if (kind == VolumeCorrection::none)
      EXPECT_LT(trace(tau), -1e4);
    else
      EXPECT_NEAR(trace(tau), 0, 1e-9);
  }
}

TEST(Sand, ACollapsedOrInvertedTrialStateIsRepaired) {
  for (const double last : {0.0, -0.3, 1e-9}) {
    const auto m = material_parameters<double>(preset("taichi_sand"));
    Mat3d F = Mat3d::diagonal({1.0, 1.0, last});
    double v_c = 0;
    const Mat3d tau = map_and_stress(m, 1e-3, svd(F), F, v_c);
    EXPECT_GT(determinant(F), 0);
    EXPECT_TRUE(std::isfinite(largest_entry(tau)));
  }
}

}  // namespace
}  // namespace graupel::mpm
