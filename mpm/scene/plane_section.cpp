#include "mpm/scene/plane_section.h"

#include <algorithm>
#include <cmath>

namespace graupel::mpm {

PlaneSection::PlaneSection(const Source& source, const SourceBody& body, double plane)
    : body_(body), height_(plane - source.position[2]) {
  const Mat3d rotation = source.rotation();
  normal_ = {rotation(2, 0), rotation(2, 1), rotation(2, 2)};
  Vec3d helper = Vec3d::zero();
  helper[std::abs(normal_[0]) > 0.9 ? 1 : 0] = 1;
  across_[0] = normalized(helper - dot(helper, normal_) * normal_);
  across_[1] = cross(normal_, across_[0]);
  low_ = Vec2d::filled(1e300);
  high_ = Vec2d::filled(-1e300);
  double lowest = 1e300, highest = -1e300;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d x;
    for (int d = 0; d < 3; ++d) x[d] = corner >> d & 1 ? body.bounds().high[d] : body.bounds().low[d];
    for (int a = 0; a < 2; ++a) {
      low_[a] = std::min(low_[a], dot(x, across_[a]));
      high_[a] = std::max(high_[a], dot(x, across_[a]));
    }
    lowest = std::min(lowest, dot(x, normal_));
    highest = std::max(highest, dot(x, normal_));
  }
  is_met_ = lowest <= height_ && height_ <= highest;
}

double PlaneSection::area() const {
  constexpr int n = 512;  // points along an axis
  const Vec2d extent = high_ - low_;
  int64_t inside = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      inside += contains({low_[0] + extent[0] * (i + 0.5) / n, low_[1] + extent[1] * (j + 0.5) / n});
  return extent[0] * extent[1] * static_cast<double>(inside) / (double(n) * n);
}

}  // namespace graupel::mpm
