// Laws that every material obeys, for every preset in f32 and f64, by numbers and by lanes: symmetric and objective
// stress, none at rest, stress as the derivative of the energy, a yield surface that holds, dissipation that is not
// negative, wave speed.
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/materials/material.h"
#include "tests/mpm/kernels/lane_step.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

/// A scalar that the laws are written over: float, double or Pack of them.
template <typename S>
class MaterialLaws : public testing::Test {};
using Scalars = testing::Types<float, double, Pack<float>, Pack<double>>;
TYPED_TEST_SUITE(MaterialLaws, Scalars);

template <typename S>
struct State : Particle<Real<S>> {
  using T = Real<S>;
  using Particle<T>::Particle;
  void step(const MaterialParameters<T>& m, const Mat<T, 3>& C, T dt) {
    if constexpr (std::is_same_v<S, T>)
      step_by_scalars(m, dt, C, *this);
    else
      step_by_equal_lanes(m, dt, C, *this);
  }
};

template <typename T>
Mat<T, 3> some_rotation() {
  return rotation_about(normalized(Vec3d{1, -2, 0.5}), 0.8).template cast<T>();
}

/// rho0 c^2 at rest [Pa]: the measure of what counts as zero stress.
template <typename T>
T stiffness(const MaterialParameters<T>& m) {
  return m.density * m.elastic_speed * m.elastic_speed + m.viscosity;
}

template <typename T>
constexpr T rounding = sizeof(T) == 4 ? T(1e-5) : T(1e-13);

TYPED_TEST(MaterialLaws, NothingIsStressedAtRest) {
  using T = Real<TypeParam>;
  for (const std::string& name : material_preset_names()) {
    const auto m = material_parameters<T>(preset(name));
    State<TypeParam> state(m);
    for (int i = 0; i < 3; ++i) state.step(m, Mat<T, 3>::zero(), T(1e-3));
    EXPECT_LE(largest_entry(state.tau), T(0.1) * rounding<T> * stiffness(m)) << name;
    EXPECT_LE(largest_entry(state.F - Mat<T, 3>::identity()), rounding<T>) << name;
    EXPECT_EQ(state.internal, static_cast<T>(initial_internal_variable(m.model))) << name;
  }
}

/// A turned trial state gives the turned stress and the turned elastic F, with plastic flow and without.
TYPED_TEST(MaterialLaws, StressTurnsWithTheFrameAndIsSymmetric) {
  using T = Real<TypeParam>;
  const Mat<T, 3> R = some_rotation<T>();
  for (const std::string& name : material_preset_names())
    for (uint64_t i = 0; i < 24; ++i) {
      const auto m = material_parameters<T>(preset(name));
      if (m.model == MaterialModel::stationary) continue;
      const T size = i % 2 == 0 ? T(2e-4) : T(0.05), dt = T(1e-3);
      State<TypeParam> state(m), turned(m);
      state.F = Mat<T, 3>::identity() + random_matrix<T, 3>(i, static_cast<double>(size));
      turned.F = R * state.F;
      const Mat<T, 3> C = random_matrix<T, 3>(i + 40, 1);
      state.step(m, C, dt);
      turned.step(m, R * C * transpose(R), dt);
      const T scale = T(20) * stiffness(m);
      EXPECT_LT(largest_entry(turned.tau - R * state.tau * transpose(R)), rounding<T> * scale) << name;
      EXPECT_LT(largest_entry(state.tau - transpose(state.tau)), rounding<T> * scale) << name;
      EXPECT_NEAR(turned.internal, state.internal, T(20) * rounding<T>) << name;
      const Mat<T, 3> expected = keeps_deformation(m.model) ? R * state.F : turned.F;
      EXPECT_LT(largest_entry(turned.F - expected), T(20) * rounding<T>) << name;
    }
}

TEST(Materials, SinglePrecisionStressIsThatOfDoublePrecision) {
  for (const std::string& name : material_preset_names()) {
    const auto single = material_parameters<float>(preset(name));
    const auto exact = material_parameters<double>(preset(name));
    State<float> a(single);
    State<double> b(exact);
    for (int i = 0; i < 5; ++i) {
      const Mat3d C = random_matrix<double, 3>(i, 20);
      a.step(single, C.cast<float>(), 1e-3f);
      b.step(exact, C, 1e-3);
    }
    EXPECT_LE(largest_entry(a.tau.template cast<double>() - b.tau), 3e-5 * stiffness(exact)) << name;
  }
}

/// Not yielding for any preset whose strength allows it: nearly isotropic compression by 2e-3.
template <typename T>
Mat<T, 3> elastic_state(uint64_t i) {
  return T(0.998) * Mat<T, 3>::identity() + random_matrix<T, 3>(i, 2e-5);
}

/// The derivative is that of the energy in f64.
TYPED_TEST(MaterialLaws, KirchhoffStressIsTheDerivativeOfTheEnergy) {
  using T = Real<TypeParam>;
  const double h = 1e-7;
  for (const std::string& name : material_preset_names()) {
    const auto m = material_parameters<T>(preset(name));
    const auto exact = material_parameters<double>(preset(name));
    if (!keeps_deformation(m.model)) continue;
    const bool elastic = m.model == MaterialModel::jelly || m.model == MaterialModel::neo_hookean;
    State<TypeParam> state(m);
    const Mat<T, 3> start = elastic ? Mat<T, 3>::identity() + random_matrix<T, 3>(3, 0.2) : elastic_state<T>(3);
    state.F = start;
    state.step(m, Mat<T, 3>::zero(), T(1e-3));
    ASSERT_LT(largest_entry(state.F - start), T(10) * std::numeric_limits<T>::epsilon())
        << name << " yields, choose a smaller state";
    const Mat3d F = start.template cast<double>();
    Mat3d PFt = Mat3d::zero();
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        Mat3d high = F, low = F;
        high(r, c) += h;
        low(r, c) -= h;
        const double internal = static_cast<double>(state.internal);
        const double P = (energy_density(exact, high, internal) - energy_density(exact, low, internal)) / (2 * h);
        for (int k = 0; k < 3; ++k) PFt(r, k) += P * F(k, c);
      }
    const Mat3d tau = state.tau.template cast<double>();
    const double rounding_of_tau = static_cast<double>(rounding<T> * stiffness(m));
    EXPECT_LT(largest_entry(PFt - tau), 2e-6 * largest_entry(tau) + rounding_of_tau) << name;
    EXPECT_GT(energy_density(exact, F, static_cast<double>(state.internal)), 0) << name;
  }
}

/// What |dev tau| may be at most: strength of metal and cake, Drucker-Prager's cone of sand, and of Herschel-Bulkley
/// flow without viscosity the yield stress.
template <typename T>
T strength_of(const MaterialParameters<T>& m, const Mat<T, 3>& tau, T internal) {
  if (m.model == MaterialModel::sand) return T(2) * m.mu * m.cohesion_length - m.friction * trace(tau);
  if (m.model == MaterialModel::metal || m.model == MaterialModel::cake)
    return std::max(T(0), von_mises_strength(m, internal));
  return m.yield_strength;
}

TYPED_TEST(MaterialLaws, StressStaysWithinTheYieldSurface) {
  using T = Real<TypeParam>;
  for (const std::string& name : material_preset_names()) {
    MaterialConfig config = preset(name);
    config.consistency = 0;
    config.hardening_update = HardeningUpdate::after;
    config.elasticity = Elasticity::hencky;
    config.volume_correction = VolumeCorrection::klar;
    const auto m = material_parameters<T>(config);
    if (!needs_svd(m.model)) continue;
    State<TypeParam> state(m);
    for (uint64_t i = 0; i < 60; ++i) {
      state.step(m, random_matrix<T, 3>(i, i % 9 == 8 ? 60 : 10), T(1e-3));
      if (m.model == MaterialModel::snow) {
        const Vec<T, 3> sigma = svd(state.F).sigma;
        EXPECT_LE(sigma[0], T(1) + m.critical_stretch + T(10) * rounding<T>);
        EXPECT_GE(sigma[2], T(1) - m.critical_compression - T(10) * rounding<T>);
        continue;
      }
      const Mat<T, 3> dev = state.tau - (trace(state.tau) / T(3)) * Mat<T, 3>::identity();
      EXPECT_LE(std::sqrt(double_dot(dev, dev)), strength_of(m, state.tau, state.internal) + rounding<T> * stiffness(m))
          << name << " step " << i;
    }
  }
}

TEST(Materials, WaterPressureIsTheDerivativeOfItsEnergy) {
  const double h = 1e-6;
  for (const char* name : {"taichi_water", "tait_water", "claymore_water"})
    for (const double J : {0.9, 0.97, 1.02}) {
      const auto m = material_parameters<double>(preset(name));
      const double derivative = (water_energy(m, J + h) - water_energy(m, J - h)) / (2 * h);
      EXPECT_NEAR(water_stress(m, J), J * derivative, 1e-6 * m.bulk_modulus) << name;
      // c^2 = dp/drho = J^2 psi'' / rho0
      const double curvature = (water_energy(m, J + h) - 2 * water_energy(m, J) + water_energy(m, J - h)) / (h * h);
      EXPECT_NEAR(water_sound_speed(m, J), J * std::sqrt(curvature / m.density), 1e-2) << name;
    }
  MaterialConfig config = preset("tait_water");
  config.tait_exponent = 1;
  const auto m = material_parameters<double>(config);
  EXPECT_NEAR(water_energy(m, 0.9), m.bulk_modulus * (0.9 - 1 - std::log(0.9)), 1e-6);
}

TEST(Materials, StableNeoHookeanSeesTheLameConstantsAtSmallStrain) {
  const auto m = material_parameters<double>(preset("neo_hookean"));
  const double e = 1e-6;
  EXPECT_NEAR(neo_hookean_stress(m, Mat3d::diagonal({1 + e, 1, 1}))(0, 0), (m.lambda + 2 * m.mu) * e, 1e-10 * m.mu);
  EXPECT_NEAR(neo_hookean_stress(m, Mat3d::diagonal({1 + e, 1, 1}))(1, 1), m.lambda * e, 1e-10 * m.mu);
  const Mat<double, 2> shear = {{{1, e}, {0, 1}}};
  EXPECT_NEAR(neo_hookean_stress(m, shear)(0, 1), m.mu * e, 1e-10 * m.mu);
  // LiCROM's constants before the remapping: mu' = lambda' = 5e5.
  const auto k = neo_hookean_constants<3>(material_parameters<double>(preset("licrom_holes")));
  EXPECT_NEAR(k.mu, 5e5, 1e-6);
  EXPECT_NEAR(k.lambda, 5e5, 1e-6);
}

TEST(Materials, NeoHookeanStressIsFiniteThroughInversion) {
  const auto m = material_parameters<double>(preset("neo_hookean"));
  for (const double s : {0.1, 0.0, -0.5}) {
    const Mat3d tau = neo_hookean_stress(m, Mat3d::diagonal({1, 1, s}));
    EXPECT_TRUE(std::isfinite(largest_entry(tau)));
  }
}

/// tau : (trial - new logarithmic strain) of one step, in the axes of the trial state.
template <typename S, typename T>
T dissipation(const MaterialParameters<T>& m, State<S>& state, const Mat<T, 3>& C, T dt) {
  const Mat<T, 3> trial = (Mat<T, 3>::identity() + dt * C) * state.F;
  const Svd<T, 3> d = svd(trial);
  state.step(m, C, dt);
  const Mat<T, 3> sigma = transpose(d.U) * state.F * d.V, tau = transpose(d.U) * state.tau * d.U;
  T sum = 0;
  for (int i = 0; i < 3; ++i) sum += tau(i, i) * (std::log(d.sigma[i]) - std::log(sigma(i, i)));
  return sum;
}

TYPED_TEST(MaterialLaws, PlasticFlowDissipates) {
  using T = Real<TypeParam>;
  for (const std::string& name : material_preset_names()) {
    const auto m = material_parameters<T>(preset(name));
    // Snow's clamp has no yield surface in stress (materials/snow.h); the other models do not flow.
    if (!needs_svd(m.model) || m.model == MaterialModel::snow || m.model == MaterialModel::jelly) continue;
    State<TypeParam> state(m);
    state.F = T(0.995) * Mat<T, 3>::identity();  // so that sand resists shear
    T total = 0;
    for (uint64_t i = 0; i < 60; ++i) {
      const T spent = dissipation(m, state, random_matrix<T, 3>(i, i % 9 == 8 ? 60 : 10), T(1e-3));
      EXPECT_GE(spent, -rounding<T> * stiffness(m)) << name;
      total += spent;
    }
    EXPECT_GT(total, 0) << name << " did not flow";
  }
}

TEST(Materials, SnowDissipatesUnderUniaxialAndIsotropicLoad) {
  const auto m = material_parameters<double>(preset("snow"));
  for (const Vec3d& rate : {Vec3d{-1, 0, 0}, Vec3d{1, 0, 0}, Vec3d{-1, -1, -1}, Vec3d{1, 1, 1}}) {
    State<double> state(m);
    for (int i = 0; i < 60; ++i) EXPECT_GE(dissipation(m, state, Mat3d::diagonal(rate), 1e-3), -1e-9);
  }
}

/// The wave speed that the step size sees is not below that of a small longitudinal wave along any axis of the state.
TEST(Materials, SoundSpeedBoundsTheWavesOfDeformedStates) {
  const double h = 1e-5;
  for (const char* name : {"jelly", "neo_hookean", "toothpaste", "metal", "cake", "foam", "nsf_cake"})
    for (const Vec3d& stretch : {Vec3d{1, 1, 1}, Vec3d{0.9, 0.9, 0.9}, Vec3d{1.4, 1.4, 1.4}, Vec3d{1.5, 1, 1}}) {
      MaterialConfig config = preset(name);
      config.yield_stress = 1e9 * config.youngs_modulus;  // elastic
      config.elasticity = std::string(name) == "nsf_cake" ? Elasticity::corotated : Elasticity::hencky;
      const auto m = material_parameters<double>(config);
      const Mat3d F = Mat3d::diagonal(stretch);
      MaterialParameters<double> strength_free =
          m;  // the strength is part of the bound, not of the material's pressure
      strength_free.yield_strength = 0;
      strength_free.hardening_slope = m.model == MaterialModel::cake ? 1 : 0;
      const double J = determinant(F), e = m.model == MaterialModel::cake ? 1e-9 : 0;
      const double c = sound_speed(strength_free, F, internal_variable_is_volume_ratio(m.model) ? J : e);
      for (int axis = 0; axis < 3; ++axis) {
        Mat3d high = F, low = F;  // F after a further strain h along the axis
        high(axis, axis) *= 1 + h;
        low(axis, axis) *= 1 - h;
        const double curvature =
            (energy_density(m, high, 0.0) - 2 * energy_density(m, F, 0.0) + energy_density(m, low, 0.0)) / (h * h);
        EXPECT_GE(c * c * m.density, curvature * (1 - 1e-3)) << name << " " << stretch[0] << " axis " << axis;
      }
    }
}

TEST(Materials, ElasticSpeedIsTheWaveSpeedAtRest) {
  for (const std::string& name : material_preset_names()) {
    const auto m = material_parameters<double>(preset(name));
    const double rest = initial_internal_variable(m.model);
    const double c = sound_speed(m, Mat3d::identity(), rest);
    EXPECT_GE(c, m.elastic_speed) << name;
    EXPECT_LE(c, m.elastic_speed * 1.05) << name;
  }
}

/// NSF, Table 1: name, step [s] and grid spacing [m]. The chosen moduli and densities fit its explicit solver.
TEST(Materials, NsfPresetsAreStableAtThePapersStepsAndGrids) {
  const std::tuple<const char*, double, double> scenes[] = {
      {"nsf_bread", 0.001, 0.0063}, {"nsf_cake", 0.0016, 0.0063},      {"nsf_sand", 0.002, 0.0067},
      {"nsf_metal", 0.0015, 0.01},  {"nsf_toothpaste", 0.001, 0.0063}, {"nsf_jelly", 0.01, 0.02},
      {"nsf_ball", 0.002, 0.0067}};
  for (const auto& [name, dt, dx] : scenes) {
    const double courant = material_parameters<double>(preset(name)).elastic_speed * dt / dx;
    EXPECT_LT(courant, 1.0) << name;  // sand, the one set that is published whole, has 0.995
    EXPECT_GT(courant, 0.3) << name;
  }
}

std::string material_error(const MaterialConfig& material) {
  try {
    check_material(material);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Materials, ConstantsOutOfRangeAreRefusedByName) {
  for (const std::string& name : material_preset_names()) EXPECT_EQ(material_error(preset(name)), "");
  MaterialConfig m = preset("metal");
  m.poissons_ratio = 0.5;
  EXPECT_EQ(material_error(m),
            "material 'metal': poissons_ratio is out of range (0.5, allowed from 0 to below 0.5). Change the value");
  m = preset("metal");
  m.youngs_modulus = -1;
  EXPECT_NE(material_error(m).find("youngs_modulus is out of range (-1, allowed above 0)"), std::string::npos);
  m = preset("water");
  m.youngs_modulus = -1;  // means nothing to water
  EXPECT_EQ(material_error(m), "");
  m.viscosity = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(material_error(m).find("viscosity is out of range (nan"), std::string::npos);
}

TEST(Materials, ARunRefusesConstantsOutOfRange) {
  Scene scene = scene_with("jelly");
  scene.materials["jelly"].poissons_ratio = 0.5;
  EXPECT_THROW(Simulation::create(scene, {}), ConfigError);
}

}  // namespace
}  // namespace graupel::mpm
