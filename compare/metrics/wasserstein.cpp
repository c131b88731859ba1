#include "compare/metrics/wasserstein.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace graupel::compare {

namespace {

/// (value, weight), ascending.
std::vector<std::pair<double, double>> sorted(const Distribution& d) {
  std::vector<std::pair<double, double>> steps;
  for (std::size_t i = 0; i < d.value.size(); ++i) steps.emplace_back(d.value[i], d.weight[i]);
  std::sort(steps.begin(), steps.end());
  return steps;
}

}  // namespace

double wasserstein_1(const Distribution& a, const Distribution& b) {
  const double total_a = std::accumulate(a.weight.begin(), a.weight.end(), 0.0),
               total_b = std::accumulate(b.weight.begin(), b.weight.end(), 0.0);
  if (total_a <= 0 || total_b <= 0) return total_a <= 0 && total_b <= 0 ? 0 : std::numeric_limits<double>::infinity();
  const auto step_a = sorted(a), step_b = sorted(b);
  double below_a = 0, below_b = 0, distance = 0;  // sums apart, so that equal distributions have exactly 0
  double last = std::min(step_a.front().first, step_b.front().first);
  for (std::size_t i = 0, j = 0; i < step_a.size() || j < step_b.size();) {
    const bool of_a = j == step_b.size() || (i < step_a.size() && step_a[i].first <= step_b[j].first);
    const double value = of_a ? step_a[i].first : step_b[j].first;
    distance += std::abs(below_a / total_a - below_b / total_b) * (value - last);
    last = value;
    if (of_a)
      below_a += step_a[i++].second;
    else
      below_b += step_b[j++].second;
  }
  return distance;
}

}  // namespace graupel::compare
