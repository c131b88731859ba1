#include "compare/metrics/density_grid.h"

#include <algorithm>
#include <cmath>

namespace graupel::compare {

DensityGrid::DensityGrid(const Domain& domain)
    : space_(domain), origin_(domain.origin), spacing_(Vec3d::filled(2 * domain.dx)) {
  for (int d = 0; d < space_.axes; ++d) {
    count_[d] = static_cast<int>(std::ceil(domain.size[d] / spacing_[d] - 1e-9)) + 1;
    if (!space_.is_periodic(d)) continue;
    count_[d] = std::max(1, static_cast<int>(std::lround(space_.period[d] / spacing_[d])));
    spacing_[d] = space_.period[d] / count_[d];
    origin_[d] = space_.low[d];
  }
}

DensityGrid::Field DensityGrid::spread(const ParticleRun& run, std::size_t frame,
                                       const std::vector<int32_t>& types) const {
  Field field;
  field.mass.assign(types.size(), std::vector<double>(static_cast<std::size_t>(nodes()), 0.0));
  field.material_fill = field.mass;
  field.fill.assign(static_cast<std::size_t>(nodes()), 0.0);
  double cell_volume = 1;
  for (int d = 0; d < space_.axes; ++d) cell_volume *= spacing_[d];
  for (std::size_t i = 0; i < run.size(); ++i) {
    const auto type = std::find(types.begin(), types.end(), run.trajectory.particle_type[i]) - types.begin();
    if (type == static_cast<std::ptrdiff_t>(types.size()) || !run.is_active(frame, i)) continue;
    Vec3i base = {0, 0, 0};
    Vec3d offset = {0, 0, 0};
    for (int d = 0; d < space_.axes; ++d) {
      double u = (run.position(frame)[i][d] - origin_[d]) / spacing_[d];
      if (!space_.is_periodic(d)) u = std::clamp(u, 0.0, count_[d] - 1.0);
      const double low = space_.is_periodic(d) ? std::floor(u) : std::min(std::floor(u), count_[d] - 2.0);
      base[d] = static_cast<int>(low);
      offset[d] = u - low;
    }
    for (int corner = 0; corner < (1 << space_.axes); ++corner) {
      double weight = 1;
      int64_t node = 0;
      for (int d = 0; d < space_.axes; ++d) {
        const int upper = (corner >> d) & 1;
        weight *= upper ? offset[d] : 1 - offset[d];
        int index = base[d] + upper;
        if (space_.is_periodic(d)) index = (index % count_[d] + count_[d]) % count_[d];
        node = node * count_[d] + index;
      }
      field.mass[static_cast<std::size_t>(type)][static_cast<std::size_t>(node)] += weight * run.mass[i];
      const double filled = weight * run.volume[i] / cell_volume;
      field.material_fill[static_cast<std::size_t>(type)][static_cast<std::size_t>(node)] += filled;
      field.fill[static_cast<std::size_t>(node)] += filled;
    }
  }
  return field;
}

double DensityGrid::relative_l1(const Field& truth, const Field& other) {
  double difference = 0, total = 0;
  for (std::size_t t = 0; t < truth.mass.size(); ++t)
    for (std::size_t n = 0; n < truth.mass[t].size(); ++n) {
      difference += std::abs(truth.mass[t][n] - other.mass[t][n]);
      total += truth.mass[t][n];
    }
  if (total > 0) return difference / total;
  return difference > 0 ? 2 : 0;
}

namespace {

double overlap(const std::vector<double>& truth, const std::vector<double>& other) {
  int64_t both = 0, either = 0;
  for (std::size_t n = 0; n < truth.size(); ++n) {
    const bool in_truth = truth[n] > occupied_fill, in_other = other[n] > occupied_fill;
    both += in_truth && in_other;
    either += in_truth || in_other;
  }
  return either > 0 ? static_cast<double>(both) / static_cast<double>(either) : 1;
}

}  // namespace

double DensityGrid::occupancy_iou(const Field& truth, const Field& other) { return overlap(truth.fill, other.fill); }

double DensityGrid::occupancy_iou(const Field& truth, const Field& other, std::size_t type) {
  return overlap(truth.material_fill[type], other.material_fill[type]);
}

}  // namespace graupel::compare
