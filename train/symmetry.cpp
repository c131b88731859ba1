#include "train/symmetry.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace graupel::train {

namespace {

/// Turns rows of features one after the other; the order of the parts is that of graph::particle_features.
class RowTurner {
 public:
  RowTurner(const Symmetry& symmetry, const graph::HgnConfig& config, const graph::Normalization& normalization)
      : symmetry_(symmetry), config_(config), normalization_(normalization) {}

  void turn(float* row) const {
    for (int64_t k = 0; k < config_.history; ++k) row = turn_velocity(row);
    if (config_.cell_normal) row = turn_vector(row);
    row = turn_walls(row);
    if (config_.signed_distance) turn_vector(row + 1);  // after the distance
  }

 private:
  float* turn_vector(float* row) const {
    const Vec3f turned = symmetry_.apply(Vec3f{row[0], row[1], row[2]});
    for (int d = 0; d < 3; ++d) row[d] = turned[d];
    return row + 3;
  }

  /// Normalised per axis, so turned in physical units.
  float* turn_velocity(float* row) const {
    for (int d = 0; d < 3; ++d) row[d] = row[d] * normalization_.velocity_std[d] + normalization_.velocity_mean[d];
    turn_vector(row);
    for (int d = 0; d < 3; ++d) row[d] = (row[d] - normalization_.velocity_mean[d]) / normalization_.velocity_std[d];
    return row + 3;
  }

  /// Distances to the three lower faces, then to the three upper ones: a reflection exchanges them.
  float* turn_walls(float* row) const {
    const std::array<float, 3> low = {row[0], row[1], row[2]}, high = {row[3], row[4], row[5]};
    for (std::size_t d = 0; d < 3; ++d) {
      const auto from = static_cast<std::size_t>(symmetry_.axis[d]);
      row[d] = symmetry_.sign[d] > 0 ? low[from] : high[from];
      row[d + 3] = symmetry_.sign[d] > 0 ? high[from] : low[from];
    }
    return row + 6;
  }

  const Symmetry& symmetry_;
  const graph::HgnConfig& config_;
  const graph::Normalization& normalization_;
};

}  // namespace

std::vector<Symmetry> symmetries_of(const Vec3d& gravity) {
  std::vector<Symmetry> found;
  std::array<int, 3> axis = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      const Symmetry symmetry{axis, {signs & 1 ? -1 : 1, signs & 2 ? -1 : 1, signs & 4 ? -1 : 1}};
      const Vec3d moved = symmetry.apply(gravity) - gravity;
      if (moved[0] == 0 && moved[1] == 0 && moved[2] == 0) found.push_back(symmetry);
    }
  } while (std::next_permutation(axis.begin(), axis.end()));
  return found;
}

Symmetry draw_symmetry(const Vec3d& gravity, const Random& random) {
  const std::vector<Symmetry> all = symmetries_of(gravity);
  return all[random.integer(0, 0, static_cast<uint32_t>(all.size()))];
}

void apply_to_features(const Symmetry& symmetry, const graph::HgnConfig& config,
                       const graph::Normalization& normalization, std::vector<float>& features) {
  const auto width = static_cast<std::size_t>(config.input_width() - config.embedding);
  GRAUPEL_ASSERT(features.size() % width == 0);
  const RowTurner turner(symmetry, config, normalization);
  for (std::size_t begin = 0; begin < features.size(); begin += width) turner.turn(features.data() + begin);
}

void apply_to_box(const Symmetry& symmetry, Vec3d& low, Vec3d& high) {
  const Vec3d a = symmetry.apply(low), b = symmetry.apply(high);
  for (int d = 0; d < 3; ++d) {
    low[d] = std::min(a[d], b[d]);
    high[d] = std::max(a[d], b[d]);
  }
}

}  // namespace graupel::train
