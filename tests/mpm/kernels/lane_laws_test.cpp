// The vectorised step of every material equals the scalar one, each lane its own particle, on random states that deform
// elastically, flow, break and come apart.
#include <gtest/gtest.h>

#include "tests/mpm/kernels/lane_step.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

/// Every preset, and variants of the laws that no preset has.
std::vector<MaterialConfig> all_variants() {
  std::vector<MaterialConfig> all;
  for (const std::string& name : material_preset_names()) {
    MaterialConfig m = preset(name);
    if (m.model == MaterialModel::stationary) continue;
    m.name = name;
    all.push_back(m);
    if (m.model == MaterialModel::toothpaste || m.model == MaterialModel::foam)
      for (const double n : {0.4, 1.0, 1.7}) {
        m.flow_index = n;
        m.yield_stress *= 0.1;
        m.name = name + " n " + std::to_string(n);
        all.push_back(m);
      }
    if (m.model == MaterialModel::cake || m.model == MaterialModel::snow || m.model == MaterialModel::metal) {
      m.hardening_update = HardeningUpdate::before;
      m.elasticity = Elasticity::corotated;
      m.yield_stress *= 0.1;
      m.name = name + " before";
      all.push_back(m);
    }
    if (m.model == MaterialModel::sand)
      for (const auto correction : {VolumeCorrection::klar, VolumeCorrection::taichi, VolumeCorrection::none}) {
        m.volume_correction = correction;
        m.cohesion = 100;
        m.name = name + " cohesive";
        all.push_back(m);
      }
  }
  return all;
}

template <typename T>
class LaneLaws : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(LaneLaws, Precisions);

TYPED_TEST(LaneLaws, EveryLaneIsTheScalarLawOfEveryMaterial) {
  using T = TypeParam;
  const T eps = std::numeric_limits<T>::epsilon(), dt = T(1e-3);
  constexpr int lanes = width<T>;
  for (const MaterialConfig& config : all_variants()) {
    SCOPED_TRACE(config.name);
    const auto m = material_parameters<T>(config);
    const T stiffness = m.density * m.elastic_speed * m.elastic_speed + m.viscosity * 100;
    int compared = 0;
    for (const double size : {1e-4, 5e-3, 0.05}) {
      std::vector<Particle<T>> a(lanes, Particle<T>(m)), b(lanes, Particle<T>(m));
      for (uint64_t step = 0; step < 12; ++step) {
        std::array<Mat<T, 3>, lanes> rates;
        std::array<Particle<T>*, lanes> particles;
        for (int l = 0; l < lanes; ++l) {
          rates[l] = random_matrix<T, 3>(1000 * step + static_cast<uint64_t>(l), size / 1e-3);
          particles[l] = &a[l];
          a[l] = b[l];  // so that differences do not add up
        }
        step_by_lanes(m, dt, rates, particles);
        for (int l = 0; l < lanes; ++l) {
          step_by_scalars(m, dt, rates[l], b[l]);
          if (a[l].special) continue;
          ++compared;
          const T scale = T(1) + largest_entry(b[l].F);
          const T stress_scale = stiffness * scale * scale + largest_entry(b[l].tau);
          // Powers of far-off volume ratios (Tait's J^-7, h of snow) amplify rounding.
          const T condition = T(60) * scale;
          EXPECT_LE(largest_entry(a[l].F - b[l].F), condition * eps * scale);
          EXPECT_LE(largest_entry(a[l].tau - b[l].tau), condition * eps * stress_scale);
          EXPECT_NEAR(a[l].internal, b[l].internal, condition * eps * (T(1) + std::abs(b[l].internal)));
          // Bounds of the largest stretch have a root of what is 0 at rest.
          EXPECT_NEAR(a[l].sound_speed, b[l].sound_speed, std::sqrt(eps) * b[l].sound_speed);
          EXPECT_EQ(largest_entry(a[l].tau - transpose(a[l].tau)), T(0));
        }
      }
    }
    EXPECT_GT(compared, 20 * lanes) << "too many states are left to the scalar law";
  }
}

TYPED_TEST(LaneLaws, InvertedFlatAndUnknownStatesAreLeftToTheScalarLaw) {
  using T = TypeParam;
  for (const char* name : {"sand", "snow", "metal", "cake", "foam", "toothpaste"}) {
    const auto m = material_parameters<T>(preset(name));
    for (const T last : {T(-1), T(0.01), std::numeric_limits<T>::quiet_NaN()}) {
      Particle<T> p(m), healthy(m);
      p.F(2, 2) = last;
      std::array<Mat<T, 3>, width<T>> rates;
      rates.fill(Mat<T, 3>::zero());
      std::array<Particle<T>*, width<T>> particles;
      particles.fill(&healthy);
      particles[width<T> - 1] = &p;
      step_by_lanes(m, T(1e-3), rates, particles);
      EXPECT_TRUE(p.special) << name << " " << last;
      EXPECT_FALSE(healthy.special) << name;
    }
  }
}

}  // namespace
}  // namespace graupel::mpm
