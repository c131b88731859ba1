#include "rom/solver/reference_body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"

namespace graupel::rom {

namespace {

constexpr int reach = 3;  ///< lattice points around a particle's own: 1.5 spacings

std::size_t number(const Vec<int, 3>& at, const Vec<int, 3>& count) {
  return (static_cast<std::size_t>(at[0]) * static_cast<std::size_t>(count[1]) + static_cast<std::size_t>(at[1])) *
             static_cast<std::size_t>(count[2]) +
         static_cast<std::size_t>(at[2]);
}

}  // namespace

ReferenceBody::ReferenceBody(const std::vector<float>& reference, const std::vector<double>& volume) {
  GRAUPEL_ASSERT(!volume.empty() && reference.size() == 3 * volume.size());
  const double total = std::accumulate(volume.begin(), volume.end(), 0.0);
  width_ = 0.5 * std::cbrt(total / static_cast<double>(volume.size()));
  for (int d = 0; d < 3; ++d) {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (std::size_t p = 0; p < volume.size(); ++p) {
      const auto x = static_cast<double>(reference[3 * p + static_cast<std::size_t>(d)]);
      least = std::min(least, x);
      most = std::max(most, x);
    }
    low_[d] = least - (reach + 0.5) * width_;
    count_[d] = static_cast<int>(std::ceil((most - least) / width_)) + 2 * reach + 2;
  }
  // Every particle offers itself to the lattice points around it.
  nearest_.assign(
      static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(count_[2]),
      -1);
  std::vector<float> distance(nearest_.size(), std::numeric_limits<float>::infinity());
  for (std::size_t p = 0; p < volume.size(); ++p) {
    Vec3d x;
    Vec<int, 3> own;
    for (int d = 0; d < 3; ++d) {
      x[d] = static_cast<double>(reference[3 * p + static_cast<std::size_t>(d)]);
      own[d] = static_cast<int>((x[d] - low_[d]) / width_);
    }
    for (int i = own[0] - reach; i <= own[0] + reach; ++i)
      for (int j = own[1] - reach; j <= own[1] + reach; ++j)
        for (int k = own[2] - reach; k <= own[2] + reach; ++k) {
          const Vec3d center = low_ + width_ * Vec3d{i + 0.5, j + 0.5, k + 0.5};
          const auto d2 = static_cast<float>(norm2(center - x));
          const std::size_t at = number({i, j, k}, count_);
          if (d2 >= distance[at]) continue;
          distance[at] = d2;
          nearest_[at] = static_cast<int32_t>(p);
        }
  }
  // As many of them, the nearest first, as the volume has room for.
  std::vector<float> sorted = distance;
  const auto inside = std::min(sorted.size() - 1, static_cast<std::size_t>(std::llround(total / std::pow(width_, 3))));
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(inside), sorted.end());
  const float limit = sorted[inside];
  inside_.resize(nearest_.size());
  for (std::size_t at = 0; at < nearest_.size(); ++at) inside_[at] = distance[at] <= limit;
}

int64_t ReferenceBody::place_of(const Vec3d& point) const {
  Vec<int, 3> at;
  for (int d = 0; d < 3; ++d) {
    const double place = (point[d] - low_[d]) / width_;
    if (!(place >= 0 && place < count_[d])) return -1;
    at[d] = static_cast<int>(place);
  }
  return static_cast<int64_t>(number(at, count_));
}

int32_t ReferenceBody::particle_at(const Vec3d& point) const {
  const int64_t at = place_of(point);
  return at >= 0 && inside_[static_cast<std::size_t>(at)] ? nearest_[static_cast<std::size_t>(at)] : -1;
}

bool ReferenceBody::near(const Vec3d& point) const {
  const int64_t at = place_of(point);
  return at >= 0 && nearest_[static_cast<std::size_t>(at)] >= 0;
}

}  // namespace graupel::rom
