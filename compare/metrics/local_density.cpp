#include "compare/metrics/local_density.h"

#include <cmath>
#include <unordered_map>

#include "compare/metrics/density_grid.h"

namespace graupel::compare {

Distribution local_density(const std::vector<Vec3f>& position, const std::vector<double>& volume, double spacing,
                           const Space& space) {
  constexpr int64_t most = int64_t(1) << 20;  // cells along an axis, either way
  std::unordered_map<int64_t, double> node_volume;
  const auto number = [&](int d, int64_t index) {  // of a node along an axis, the same for all its images
    if (!space.is_periodic(d)) return index + most;
    const int64_t cells = std::llround(space.period[d] / spacing);
    return ((index % cells) + cells) % cells;
  };
  for (std::size_t i = 0; i < position.size(); ++i) {
    int64_t base[3] = {0, 0, 0};
    double offset[3] = {0, 0, 0};
    for (int d = 0; d < space.axes; ++d) {
      const double from = space.is_periodic(d) ? space.low[d] : 0, u = (position[i][d] - from) / spacing,
                   low = std::floor(u);
      base[d] = static_cast<int64_t>(low);
      offset[d] = u - low;
    }
    for (int corner = 0; corner < (1 << space.axes); ++corner) {
      double weight = 1;
      int64_t node = 0;
      for (int d = 0; d < space.axes; ++d) {
        const int upper = (corner >> d) & 1;
        weight *= upper ? offset[d] : 1 - offset[d];
        node = node * 2 * most + number(d, base[d] + upper);
      }
      node_volume[node] += weight * volume[i];
    }
  }
  Distribution density;
  const double cell = std::pow(spacing, space.axes);
  for (const auto& [node, filled] : node_volume)
    if (filled > occupied_fill * cell) density.add(filled / cell, 1);
  if (density.value.empty()) density.add(0, 1);
  return density;
}

}  // namespace graupel::compare
