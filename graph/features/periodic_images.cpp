#include "graph/features/periodic_images.h"

#include <algorithm>
#include <cmath>

namespace graupel::graph {

PeriodicImages periodic_images(const Environment& environment, const std::vector<Vec3f>& position, double layer) {
  PeriodicImages images;
  if (!environment.is_periodic()) return images;
  for (int d = 0; d < 3; ++d) {
    const double period = environment.period[d];
    if (!(period > 0)) continue;
    const double depth = std::min(layer, period);
    const double low = environment.box_low[d] + depth, high = environment.box_high[d] - depth;
    const std::size_t known = position.size() + images.source.size();  // images of images: beyond edges and corners
    for (std::size_t k = 0; k < known; ++k) {
      const bool is_particle = k < position.size();
      const std::size_t image = is_particle ? 0 : k - position.size();
      const int32_t source = is_particle ? static_cast<int32_t>(k) : images.source[image];
      const Vec3f shift = is_particle ? Vec3f::zero() : images.shift[image];
      const auto x = static_cast<double>(position[static_cast<std::size_t>(source)][d]);
      for (const double side : {1.0, -1.0}) {
        if (side > 0 ? !(x < low) : !(x > high)) continue;
        Vec3f moved = shift;
        moved[d] += static_cast<float>(side * period);
        images.source.push_back(source);
        images.shift.push_back(moved);
      }
    }
  }
  return images;
}

void unwrap_periodic(const Environment& environment, std::vector<std::vector<Vec3f>>& positions) {
  if (!environment.is_periodic()) return;
  for (std::size_t f = positions.size() - 1; f > 0; --f)
    for (std::size_t i = 0; i < positions[f].size(); ++i)
      for (int d = 0; d < 3; ++d) {
        const double period = environment.period[d];
        if (!(period > 0)) continue;
        float& older = positions[f - 1][i][d];
        const double periods = std::round((static_cast<double>(positions[f][i][d]) - older) / period);
        if (periods != 0) older = static_cast<float>(older + periods * period);
      }
}

}  // namespace graupel::graph
