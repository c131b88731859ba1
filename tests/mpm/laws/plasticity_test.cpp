// Yield surfaces, return maps and flow laws against their formulas and the angles and stresses known from theory.
#include <gtest/gtest.h>

#include "mpm/materials/material.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

constexpr double pi = 3.14159265358979323846;

template <typename T>
class Plasticity : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Plasticity, Precisions);

template <typename T>
constexpr T rounding = sizeof(T) == 4 ? T(1e-5) : T(1e-12);

template <typename T>
Vec<T, 3> principal_stress(const MaterialParameters<T>& m, const Vec<T, 3>& strain) {
  return T(2) * m.mu * strain + Vec<T, 3>::filled(m.lambda * sum_of(strain));
}

/// Trial states far outside every yield surface, some stretched.
template <typename T>
Vec<T, 3> trial_strain(int i) {
  const Random random(5, RandomPurpose::test, 0);
  Vec<T, 3> strain;
  for (int d = 0; d < 3; ++d) strain[d] = static_cast<T>(random.uniform(3 * i + d, 0, -0.3, 0.2));
  return strain;
}

// --- Drucker-Prager

/// |dev tau| - 2 sqrt(6) / (3 - sin phi) (p sin phi + c cos phi).
template <typename T>
T cone_excess(const MaterialConfig& c, const Vec<T, 3>& tau) {
  const double phi = c.friction_angle * pi / 180, p = -static_cast<double>(sum_of(tau)) / 3;
  const double bound = 2 * std::sqrt(6.0) / (3 - std::sin(phi)) * (p * std::sin(phi) + c.cohesion * std::cos(phi));
  return norm(deviator_of(tau)) - static_cast<T>(bound);
}

TYPED_TEST(Plasticity, SandIsOnTheConeOrAtItsTipAndStaysThere) {
  using T = TypeParam;
  for (const char* name : {"sand", "wet_sand", "nsf_sand", "taichi_sand", "claymore_sand"})
    for (int i = 0; i < 40; ++i) {
      const MaterialConfig config = preset(name);
      const auto m = material_parameters<T>(config);
      Vec<T, 3> strain = trial_strain<T>(i);
      const T volume = sum_of(strain);
      T v_c = 0;
      sand_return_mapping(m, strain, v_c);
      const Vec<T, 3> tau = principal_stress(m, strain);
      EXPECT_LT(cone_excess(config, tau), rounding<T> * m.mu) << name;
      const bool remembers = config.volume_correction != VolumeCorrection::none;
      EXPECT_NEAR(v_c, remembers ? volume - sum_of(strain) : T(0), rounding<T>) << name;
      Vec<T, 3> again = strain;
      T v_again = v_c;
      sand_return_mapping(m, again, v_again);
      EXPECT_LT(norm(again - strain), rounding<T>) << name;
    }
}

TEST(DruckerPrager, TriaxialCompressionFailsAtTheMohrCoulombLaw) {
  for (const double angle : {20.0, 30.0, 40.0})
    for (const double cohesion : {0.0, 800.0}) {
      MaterialConfig config = preset("sand");
      config.friction_angle = angle;
      config.cohesion = cohesion;
      const auto m = material_parameters<double>(config);
      Vec3d strain = {-0.1, 0.035, 0.035};
      double v_c = 0;
      ASSERT_TRUE(sand_return_mapping(m, strain, v_c));
      const Vec3d tau = principal_stress(m, strain);
      const double big = -tau[0], small = -tau[1], phi = angle * pi / 180;
      EXPECT_NEAR(big - small, (big + small) * std::sin(phi) + 2 * cohesion * std::cos(phi), 1e-9 * big) << angle;
    }
}

/// The friction angle in simple shear is steeper than phi (research of infinite slopes): 20/30/35/40/45 degrees give
/// 24.0/34.7/39.3/43.4/46.9.
TEST(DruckerPrager, SimpleShearFailsAtItsOwnSteeperAngle) {
  const std::pair<double, double> known[] = {{20, 24.0}, {30, 34.7}, {35, 39.3}, {40, 43.4}, {45, 46.9}};
  for (const auto& [angle, in_shear] : known) {
    MaterialConfig config = preset("dry_sand");
    config.friction_angle = angle;
    const auto m = material_parameters<double>(config);
    Vec3d strain = {0.2 - 0.01, -0.01, -0.2 - 0.01};
    double v_c = 0;
    sand_return_mapping(m, strain, v_c);
    const Vec3d tau = principal_stress(m, strain);
    const double shear = (tau[0] - tau[2]) / 2, pressure = -sum_of(tau) / 3;
    EXPECT_NEAR(std::atan(shear / pressure) * 180 / pi, in_shear, 0.06);
  }
}

TEST(DruckerPrager, CohesionHoldsTensionUntilTheGrainsComeApart) {
  MaterialConfig config = preset("sand");
  config.cohesion = 500;
  const auto m = material_parameters<double>(config);
  const double limit = 500 / std::tan(35 * pi / 180), bulk = m.lambda + 2 * m.mu / 3;
  Vec3d strain = Vec3d::filled(0.999 * limit / bulk / 3);
  double v_c = 0;
  EXPECT_FALSE(sand_return_mapping(m, strain, v_c));
  EXPECT_NEAR(principal_stress(m, strain)[0], 0.999 * limit, 1e-9);
  strain *= 1.01;
  EXPECT_TRUE(sand_return_mapping(m, strain, v_c));
  EXPECT_EQ(norm(strain), 0);
  EXPECT_GT(v_c, 0);
  strain = Vec3d::filled(-v_c / 6);  // half closed: still apart
  sand_return_mapping(m, strain, v_c);
  EXPECT_EQ(norm(strain), 0);
  strain = Vec3d::filled(-v_c);  // closed and pressed: whole again
  sand_return_mapping(m, strain, v_c);
  EXPECT_LT(sum_of(strain), 0);
  EXPECT_EQ(v_c, 0);
  config.friction_angle = 0;  // then cohesion alone bounds the shear, and nothing the tension
  const auto clay = material_parameters<double>(config);
  strain = {0.3, 0.1, 0.1};
  sand_return_mapping(clay, strain, v_c);
  const Vec3d tau = principal_stress(clay, strain);
  EXPECT_NEAR(norm(deviator_of(tau)), 2 * std::sqrt(6.0) / 3 * 500, 1e-6);
  EXPECT_NEAR(sum_of(strain), 0.5, 1e-12);
}

// --- von Mises

TYPED_TEST(Plasticity, MetalAndCakeReturnToTheirYieldSurfaceAndStayThere) {
  using T = TypeParam;
  MaterialConfig hardening = preset("metal"), perfect = preset("metal"), softening = preset("cake");
  hardening.hardening_modulus = 2e6;
  perfect.hardening_modulus = 0;
  softening.softening_modulus = 100;
  for (const MaterialConfig& config : {hardening, perfect, softening})
    for (int i = 0; i < 40; ++i) {
      const auto m = material_parameters<T>(config);
      Vec<T, 3> strain = T(4) * trial_strain<T>(i);
      T e = T(0.1);
      if (i < 36) strain = strain + Vec<T, 3>{T(0.4), T(0), T(-0.4)};  // the last four may be inside
      const T volume = sum_of(strain);
      if (!von_mises_return_mapping(m, strain, e)) {
        EXPECT_GE(i, 36);
        continue;
      }
      EXPECT_NEAR(norm(deviator_of(principal_stress(m, strain))), von_mises_strength(m, e), rounding<T> * m.mu);
      EXPECT_NEAR(sum_of(strain), volume, rounding<T>);
      EXPECT_GT(e, T(0.1));
      Vec<T, 3> again = strain;
      T e_again = e;
      von_mises_return_mapping(m, again, e_again);
      EXPECT_LT(norm(again - strain), rounding<T>);
      EXPECT_NEAR(e_again, e, rounding<T>);
    }
}

TEST(VonMises, UniaxialAndShearYieldAndHardeningSlope) {
  MaterialConfig config = preset("metal");
  config.yield_stress = 2e4;
  config.hardening_modulus = 3e5;
  const auto m = material_parameters<double>(config);
  Vec3d uniaxial = {0.02, -0.01, -0.01}, shear = {0.03, 0, -0.03};
  double e = 0;
  von_mises_return_mapping(m, uniaxial, e);
  Vec3d tau = principal_stress(m, uniaxial);
  EXPECT_NEAR(tau[0] - tau[1], 2e4 + 3e5 * e, 1e-8);
  // equivalent plastic strain: what the axial strain of the isochoric pull lost
  EXPECT_NEAR(e, 0.02 - uniaxial[0], 1e-15);
  e = 0;
  von_mises_return_mapping(m, shear, e);
  tau = principal_stress(m, shear);
  EXPECT_NEAR((tau[0] - tau[2]) / 2, (2e4 + 3e5 * e) / std::sqrt(3.0), 1e-8);
  Vec3d elastic = {0.002, -0.001, -0.001};  // 3 mu 0.002 = 1.1e4 Pa
  e = 0;
  EXPECT_FALSE(von_mises_return_mapping(m, elastic, e));
  EXPECT_EQ(e, 0);
}

/// NSF, appendix F.4: |dev tau| is bounded by tau_Y = 0.05, which rises by 2 mu xi |flow|, xi = 0.1, after the step.
TEST(VonMises, NsfMetalHardensExplicitly) {
  const auto m = material_parameters<double>(preset("nsf_metal"));
  Vec3d strain = {0.05, -0.02, -0.03};
  const Vec3d trial = strain;
  double e = 0;
  von_mises_return_mapping(m, strain, e);
  EXPECT_NEAR(norm(deviator_of(principal_stress(m, strain))), 0.05, 1e-12);
  const double flow = norm(trial - strain);
  EXPECT_NEAR(von_mises_strength(m, e), 0.05 + 2 * m.mu * 0.1 * flow, 1e-12);
}

TEST(VonMises, NsfCakeSoftensUntilItBreaks) {
  const auto m = material_parameters<double>(preset("nsf_cake"));
  Mat3d F = Mat3d::identity();
  double e = 0;
  double flow = 0;
  for (int i = 0; i < 2000 && !is_broken(m, e); ++i) {
    const Mat3d before = F;
    const Mat3d tau = update_material(m, 1e-3, Mat3d::diagonal({5, -2.5, -2.5}), F, e);
    const double strength = 0.1 - 0.03 * flow;  // tau_Y before this step: theta = 0.03
    const double axial = std::log((1 + 5e-3) * before(0, 0)) - std::log(F(0, 0));
    if (!is_broken(m, e)) {
      flow += axial * std::sqrt(1.5);
      if (axial > 1e-12) {
        EXPECT_NEAR(std::sqrt(2.0 / 3) * (tau(0, 0) - tau(1, 1)), strength, 1e-4);
      }
    } else {
      EXPECT_EQ(largest_entry(tau), 0);
      EXPECT_LT(largest_entry(F - Mat3d::identity()), 1e-12);
    }
  }
  EXPECT_TRUE(is_broken(m, e));
  EXPECT_NEAR(e, std::sqrt(2.0 / 3) * 0.1 / 0.03, 0.01);
  EXPECT_EQ(sound_speed(m, F, e), m.elastic_speed);
  const Mat3d squeezed = update_material(m, 1e-3, Mat3d::diagonal({-5, -5, -5}), F, e);
  EXPECT_EQ(largest_entry(squeezed), 0);
  EXPECT_EQ(energy_density(m, F, e), 0);
}

TEST(VonMises, StrongSofteningBreaksInOneStepWithoutNegativeStrain) {
  MaterialConfig config = preset("cake");
  config.softening_modulus = 1e7;  // steeper than elasticity: the stress snaps to zero
  const auto m = material_parameters<double>(config);
  Vec3d strain = {0.2, -0.1, -0.1};
  double e = 0;
  von_mises_return_mapping(m, strain, e);
  EXPECT_LT(norm(deviator_of(strain)), 1e-15);
  EXPECT_TRUE(is_broken(m, e));
}

TEST(VonMises, CakeByCorotatedElasticityYieldsInHenckyStrain) {
  MaterialConfig config = preset("cake");
  config.elasticity = Elasticity::corotated;
  const auto m = material_parameters<double>(config);
  Mat3d F = Mat3d::diagonal({1.2, 0.95, 0.9});
  double e = 0;
  const Mat3d tau = map_and_stress(m, 1e-3, svd(F), F, e);
  const Svd<double, 3> d = svd(F);
  EXPECT_NEAR(2 * m.mu * norm(deviator_of(logarithmic_strain(d.sigma))), von_mises_strength(m, e), 1e-8);
  EXPECT_LT(largest_entry(tau - spectral(d.U, corotated_principal_stress(m, 1.0, d.sigma))), 1e-8);
}

// --- Herschel-Bulkley and Newton

MaterialConfig flowing(const char* name, double consistency, double index) {
  MaterialConfig config = preset(name);
  config.youngs_modulus = 1e6;
  config.yield_stress = 200;
  config.consistency = consistency;
  config.flow_index = index;
  return config;
}

TYPED_TEST(Plasticity, SteadyShearStressIsYieldPlusConsistencyTimesRateToTheN) {
  using T = TypeParam;
  for (const char* name : {"toothpaste", "foam"})
    for (const double index : {0.4, 1.0, 1.6})
      for (const double rate : {1.0, 5.0}) {
        const auto m = material_parameters<T>(flowing(name, 60, index));
        Mat<T, 3> F = Mat<T, 3>::identity(), C = Mat<T, 3>::zero(), tau = Mat<T, 3>::zero();
        C(0, 1) = static_cast<T>(rate);
        T internal = static_cast<T>(initial_internal_variable(m.model));
        for (int i = 0; i < 1500; ++i) tau = update_material(m, T(1e-4), C, F, internal);
        const double expected = 200 / std::sqrt(3.0) + 60 * std::pow(rate, index);
        EXPECT_NEAR(static_cast<double>(tau(0, 1)), expected, 0.005 * expected) << name << index;
        EXPECT_NEAR(determinant(F), 1, 1e-3);
      }
}

/// NSF's form for n = 1: |s| = s_trial - (s_trial - sqrt(2/3) sigma_Y) / (1 + eta / (2 mu dt)), eta = 2 k.
TEST(HerschelBulkley, LinearStepIsThePapersFormula) {
  const auto m = material_parameters<double>(preset("nsf_toothpaste"));
  const double mu = 1.7, dt = 1e-3, trial = 0.3, eta = 0.17, strength = std::sqrt(2.0 / 3) * 0.05;
  EXPECT_NEAR(herschel_bulkley_stress(m, mu, dt, trial), trial - (trial - strength) / (1 + eta / (2 * mu * dt)), 1e-14);
}

TEST(HerschelBulkley, EveryExponentSolvesItsImplicitEquation) {
  for (const double index : {0.1, 0.3, 0.5, 0.9, 1.0, 1.1, 2.0, 3.0})
    for (const double consistency : {1e-6, 1e-2, 1.0, 100.0, 1e5})
      for (const double excess : {1e-6, 1.0, 1e4}) {
        const auto m = material_parameters<double>(flowing("foam", consistency, index));
        const double mu = 4e5, dt = 1e-4, trial = m.yield_strength + excess;
        const double s = herschel_bulkley_stress(m, mu, dt, trial);
        const double stays = s - m.yield_strength, slack = 1e-12 * trial + 1e-9 * stays;
        const auto trial_excess = [&](double y) {  // the left-hand side, which grows with y
          return y > 0 ? y + 2 * mu * dt * std::pow(y / m.flow_consistency, 1 / index) : 0;
        };
        EXPECT_GE(stays, 0);
        EXPECT_LE(trial_excess(stays - slack), excess) << index << " " << consistency << " " << excess;
        EXPECT_GE(trial_excess(stays + slack), excess) << index << " " << consistency << " " << excess;
      }
}

TYPED_TEST(Plasticity, WithoutConsistencyTheFlowIsPerfectlyPlastic) {
  using T = TypeParam;
  for (const char* name : {"toothpaste", "foam"})
    for (int i = 0; i < 20; ++i) {
      const auto m = material_parameters<T>(flowing(name, 0, 1));
      Mat<T, 3> F = Mat<T, 3>::identity() + random_matrix<T, 3>(i, 0.2);
      const T J = determinant(F);
      T internal = static_cast<T>(initial_internal_variable(m.model));
      Mat<T, 3> tau = map_and_stress(m, T(1e-4), svd(F), F, internal);
      const Mat<T, 3> s = tau - (trace(tau) / T(3)) * Mat<T, 3>::identity();
      EXPECT_NEAR(std::sqrt(double_dot(s, s)), m.yield_strength, T(20) * rounding<T> * m.mu) << name;
      EXPECT_NEAR(determinant(F), J, T(20) * rounding<T>) << name;
      Mat<T, 3> again = F;
      const Mat<T, 3> tau_again = map_and_stress(m, T(1e-4), svd(again), again, internal);
      EXPECT_LT(largest_entry(again - F), T(20) * rounding<T>) << name;
      EXPECT_LT(largest_entry(tau_again - tau), T(40) * rounding<T> * m.mu) << name;
    }
}

TYPED_TEST(Plasticity, NewtonianShearStressIsViscosityTimesRate) {
  using T = TypeParam;
  const auto m = material_parameters<T>(preset("honey"));
  Mat<T, 3> F = Mat<T, 3>::identity(), C = Mat<T, 3>::zero();
  C(0, 1) = T(3);
  T J = 1;
  const Mat<T, 3> tau = update_material(m, T(1e-4), C, F, J);
  EXPECT_NEAR(tau(0, 1), T(30), T(1e-4));
  EXPECT_NEAR(tau(1, 0), T(30), T(1e-4));
  EXPECT_NEAR(tau(0, 0), T(0), T(1e-4));
  // no bulk viscosity, power not negative
  EXPECT_NEAR(largest_entry(viscous_stress(m, T(5) * Mat<T, 3>::identity(), T(1))), 0, T(1e-4));
  for (int i = 0; i < 10; ++i) {
    const Mat<T, 3> L = random_matrix<T, 3>(i, 5), v = viscous_stress(m, L, T(0.9));
    EXPECT_GE(double_dot(v, L), T(0));
    EXPECT_NEAR(trace(v), T(0), T(1e-3));
  }
}

// --- snow

TEST(Snow, ElasticRangeAndHardeningOfThePresets) {
  const auto stomakhin = material_parameters<double>(preset("snow")),
             taichi = material_parameters<double>(preset("taichi_snow"));
  for (const auto& m : {stomakhin, taichi}) {
    Vec3d inside = {1 + m.critical_stretch, 1, 1 - m.critical_compression};
    double J_p = 1;
    EXPECT_FALSE(snow_return_mapping(m, inside, J_p));
    EXPECT_NEAR(snow_hardening(m, 0.95), std::exp(0.5), 1e-14);
  }
  EXPECT_EQ(stomakhin.critical_compression, 2.5e-2);
  EXPECT_EQ(stomakhin.critical_stretch, 7.5e-3);
}

TEST(Snow, StomakhinStressFeelsTheNewHardening) {
  const auto m = material_parameters<double>(preset("snow"));
  Mat3d F = 0.95 * Mat3d::identity();
  double J_p = 1;
  const Mat3d tau = map_and_stress(m, 1e-3, svd(F), F, J_p);
  const double s = 0.975, J = s * s * s, h = std::exp(10 * (1 - J_p));
  EXPECT_GT(h, 1.5);
  EXPECT_NEAR(tau(0, 0), h * (2 * m.mu * (s - 1) * s + m.lambda * J * (J - 1)), 1e-8);
  Mat3d again = F;  // idempotent: the state's stress is a function of the state
  EXPECT_LT(largest_entry(map_and_stress(m, 1e-3, svd(again), again, J_p) - tau), 1e-8);
}

}  // namespace
}  // namespace graupel::mpm
