#include "compare/metrics/local_density.h"

#include <cmath>
#include <unordered_map>

#include "compare/metrics/density_grid.h"

namespace graupel::compare {

Distribution local_density(const std::vector<Vec3f>& position, const std::vector<double>& volume, double spacing) {
  constexpr int64_t most = int64_t(1) << 20;  // cells along an axis, either way
  std::unordered_map<int64_t, double> node_volume;
  for (std::size_t i = 0; i < position.size(); ++i) {
    int64_t base[3];
    double offset[3];
    for (int d = 0; d < 3; ++d) {
      const double u = position[i][d] / spacing, low = std::floor(u);
      base[d] = static_cast<int64_t>(low) + most;
      offset[d] = u - low;
    }
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1;
      int64_t node = 0;
      for (int d = 0; d < 3; ++d) {
        const int upper = (corner >> d) & 1;
        weight *= upper ? offset[d] : 1 - offset[d];
        node = node * 2 * most + base[d] + upper;
      }
      node_volume[node] += weight * volume[i];
    }
  }
  Distribution density;
  const double cell = spacing * spacing * spacing;
  for (const auto& [node, filled] : node_volume)
    if (filled > occupied_fill * cell) density.add(filled / cell, 1);
  if (density.value.empty()) density.add(0, 1);
  return density;
}

}  // namespace graupel::compare
