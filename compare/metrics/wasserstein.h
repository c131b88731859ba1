// 1-Wasserstein distance between two distributions of numbers: how far, in the numbers' unit, shares must be moved.
//   W1(a, b) = integral |F_a(v) - F_b(v)| dv, F the cumulative share       (Villani 2003, remark 2.19)
#pragma once

#include <vector>

namespace graupel::compare {

/// Values with positive weights; shares are weights over their sum.
struct Distribution {
  std::vector<double> value, weight;
  void add(double v, double w) {
    value.push_back(v);
    weight.push_back(w);
  }
};

/// In the unit of the values. 0 when both are empty; infinity when one is.
double wasserstein_1(const Distribution& a, const Distribution& b);

}  // namespace graupel::compare
