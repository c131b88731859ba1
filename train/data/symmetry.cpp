#include "train/data/symmetry.h"

#include <algorithm>
#include <array>

namespace graupel::train {

std::vector<AxisMap> symmetries_of(const Vec3d& gravity, int64_t dimensions) {
  std::vector<AxisMap> found;
  std::array<int, 3> axis = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      const AxisMap symmetry{{axis[0], axis[1], axis[2]}, {signs & 1 ? -1 : 1, signs & 2 ? -1 : 1, signs & 4 ? -1 : 1}};
      if (dimensions == 2 && (symmetry.axis[2] != 2 || symmetry.sign[2] < 0)) continue;
      const Vec3d moved = symmetry.apply(gravity) - gravity;
      if (moved[0] == 0 && moved[1] == 0 && moved[2] == 0) found.push_back(symmetry);
    }
  } while (std::next_permutation(axis.begin(), axis.end()));
  return found;
}

AxisMap draw_symmetry(const Vec3d& gravity, int64_t dimensions, const Random& random) {
  const std::vector<AxisMap> all = symmetries_of(gravity, dimensions);
  return all[random.integer(0, 0, static_cast<uint32_t>(all.size()))];
}

void apply_to_box(const AxisMap& symmetry, Vec3d& low, Vec3d& high) {
  const Vec3d a = symmetry.apply(low), b = symmetry.apply(high);
  for (int d = 0; d < 3; ++d) {
    low[d] = std::min(a[d], b[d]);
    high[d] = std::max(a[d], b[d]);
  }
}

}  // namespace graupel::train
