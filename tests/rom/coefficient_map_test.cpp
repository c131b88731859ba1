// The branch's radial basis functions: value, derivative, box, storage.
#include "rom/fields/coefficient_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"

namespace graupel::rom {
namespace {

/// A map with made-up numbers.
CoefficientMap some_map(int inputs, int outputs, int count) {
  const Random random(7, RandomPurpose::test);
  uint64_t next = 0;
  const auto numbers = [&](int n) {
    std::vector<double> v(static_cast<std::size_t>(n));
    for (double& x : v) x = random.uniform(next++, 0, -1, 1);
    return v;
  };
  std::vector<double> scale = numbers(inputs);
  for (double& s : scale) s = 0.5 + std::abs(s);
  return {inputs,
          outputs,
          numbers(inputs),
          scale,
          numbers(count * inputs),
          numbers(count * outputs),
          numbers((1 + inputs) * outputs)};
}

TEST(CoefficientMap, DerivativeIsThatOfFiniteDifferences) {
  const CoefficientMap map = some_map(4, 3, 20);
  const std::vector<double> z = {0.2, -0.1, 0.3, 0.05};
  std::vector<double> jacobian(3 * 4), plus(3), minus(3);
  map.derivative(z.data(), 4, jacobian.data());
  const double h = 1e-6;
  for (int j = 0; j < 4; ++j) {
    std::vector<double> a = z, b = z;
    a[static_cast<std::size_t>(j)] += h;
    b[static_cast<std::size_t>(j)] -= h;
    map.evaluate(a.data(), plus.data());
    map.evaluate(b.data(), minus.data());
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(jacobian[static_cast<std::size_t>(4 * k + j)],
                  (plus[static_cast<std::size_t>(k)] - minus[static_cast<std::size_t>(k)]) / (2 * h), 1e-7);
  }
}

TEST(CoefficientMap, FarOutsideItIsLinear) {
  const CoefficientMap map = some_map(2, 1, 12);
  double at[3];
  for (int i = 0; i < 3; ++i) {
    const double z[] = {10.0 + i, 0.1};
    map.evaluate(z, &at[i]);
  }
  EXPECT_NEAR(at[2] - at[1], at[1] - at[0], 1e-9);
}

TEST(CoefficientMap, SurvivesStorage) {
  const CoefficientMap map = some_map(3, 2, 9);
  nn::Weights weights;
  map.store(weights, "branch");
  const CoefficientMap again = CoefficientMap::load(weights, "branch", 3, 2);
  const double z[] = {0.3, -0.4, 0.1};
  double a[2], b[2];
  map.evaluate(z, a);
  again.evaluate(z, b);
  for (int k = 0; k < 2; ++k) EXPECT_NEAR(a[k], b[k], 1e-5);
}

}  // namespace
}  // namespace graupel::rom
