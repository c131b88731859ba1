#include "graph/features/rest_density.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

namespace graupel::graph {

namespace {

/// A tenth, a half .. of the particles have so many in their cell, or more.
double count_quantile(const std::vector<Vec3f>& position, double spacing, double fraction) {
  std::vector<std::tuple<int64_t, int64_t, int64_t>> cell;
  cell.reserve(position.size());
  for (const Vec3f& x : position) {
    const auto along = [&](int d) { return static_cast<int64_t>(std::floor(static_cast<double>(x[d]) / spacing)); };
    cell.emplace_back(along(0), along(1), along(2));
  }
  std::sort(cell.begin(), cell.end());
  std::vector<std::ptrdiff_t> counts;
  counts.reserve(cell.size());
  for (auto first = cell.begin(); first != cell.end();) {
    const auto last = std::upper_bound(first, cell.end(), *first);
    counts.insert(counts.end(), static_cast<std::size_t>(last - first), last - first);
    first = last;
  }
  if (counts.empty()) return 0;
  const auto last = counts.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(counts.size()));
  std::nth_element(counts.begin(), last, counts.end(), std::greater<>());
  return static_cast<double>(*last);
}

}  // namespace

double rest_density(const Scene& scene, const std::vector<Vec3f>& start, double spacing) {
  const double fraction = scene.sources.empty() && scene.emitters.empty() ? 0.1 : 0.5;
  double density = count_quantile(start, spacing, fraction) / std::pow(spacing, 3);
  for (const Source& source : scene.sources)
    density = std::max(density, source.particles_per_cell / scene.domain.cell_volume());
  for (const Emitter& emitter : scene.emitters)
    density = std::max(density, emitter.particles_per_cell / scene.domain.cell_volume());
  return density;
}

}  // namespace graupel::graph
