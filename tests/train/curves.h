// A smooth function along curves in a space of few dimensions, for tests of regressions.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace graupel::train {

/// Points of `runs` runs along a curve, and a smooth function of them.
struct Curves {
  Eigen::MatrixXd inputs, rates, outputs;
  std::vector<int> run;
  Curves(int runs, int points, bool times_rate)
      : inputs(runs * points, 3), rates(runs * points, 2), outputs(runs * points, 2) {
    for (int r = 0; r < runs; ++r)
      for (int i = 0; i < points; ++i) {
        const double t = static_cast<double>(i) / points, mu = static_cast<double>(r) / runs;
        const Eigen::Index n = r * points + i;
        inputs.row(n) << std::sin(2 * t) + 0.1 * mu, t * t, mu;
        rates.row(n) << std::cos(3 * t), 1 + mu * t;
        const double a = std::exp(inputs(n, 0)) + mu, b = inputs(n, 1) * mu;
        outputs.row(n) << (times_rate ? a * rates(n, 0) + rates(n, 1) : a), (times_rate ? b * rates(n, 1) : b);
        run.push_back(r);
      }
  }
};

}  // namespace graupel::train
