#include "rom/quadrature.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/error.h"

namespace graupel::rom {

namespace {

/// Bits of x, 0 to 2^21 - 1, with two zeros between any two.
uint64_t spread_bits(uint64_t x) {
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

struct Box {
  Vec3f low = Vec3f::filled(std::numeric_limits<float>::max()),
        high = Vec3f::filled(std::numeric_limits<float>::lowest());
  float longest = 0;
};

Box box_of(const std::vector<Vec3f>& points) {
  Box box;
  for (const Vec3f& x : points)
    for (int d = 0; d < 3; ++d) {
      box.low[d] = std::min(box.low[d], x[d]);
      box.high[d] = std::max(box.high[d], x[d]);
    }
  for (int d = 0; d < 3; ++d) box.longest = std::max(box.longest, box.high[d] - box.low[d]);
  return box;
}

/// Particles in Morton order.
std::vector<int32_t> curve_order(const std::vector<Vec3f>& points) {
  const Box box = box_of(points);
  const float scale = box.longest > 0 ? 2097151.0f / box.longest : 0;
  std::vector<std::pair<uint64_t, int32_t>> keyed;
  keyed.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    uint64_t key = 0;
    for (int d = 0; d < 3; ++d)
      key |= spread_bits(static_cast<uint64_t>((points[i][d] - box.low[d]) * scale)) << (2 - d);
    keyed.emplace_back(key, static_cast<int32_t>(i));
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<int32_t> order;
  order.reserve(points.size());
  for (const auto& [key, particle] : keyed) order.push_back(particle);
  return order;
}

/// Finds the nearest of some points, by cells of about one point each.
class NearestPoint {
 public:
  explicit NearestPoint(const std::vector<Vec3f>& points) : points_(points), box_(box_of(points)) {
    const double count = std::max<double>(1, static_cast<double>(points.size()));
    cell_ = static_cast<float>(std::max(1e-12, static_cast<double>(box_.longest) / std::cbrt(count)));
    for (int d = 0; d < 3; ++d) cells_[d] = static_cast<int>((box_.high[d] - box_.low[d]) / cell_) + 1;
    members_.resize(static_cast<std::size_t>(cells_[0]) * static_cast<std::size_t>(cells_[1]) *
                    static_cast<std::size_t>(cells_[2]));
    for (std::size_t i = 0; i < points.size(); ++i) members_[number(cell_of(points[i]))].push_back(i);
  }

  std::size_t operator()(const Vec3f& x) const {
    const Vec<int, 3> c = cell_of(x);
    std::size_t best = 0;
    float least = std::numeric_limits<float>::max();
    const int rings = std::max({cells_[0], cells_[1], cells_[2]});
    for (int ring = 0; ring <= rings; ++ring) {
      visit_ring(c, ring, [&](std::size_t i) {
        const float distance = norm2(points_[i] - x);
        if (distance < least || (distance == least && i < best)) {
          least = distance;
          best = i;
        }
      });
      const float safe = static_cast<float>(ring) * cell_;  // everything nearer lies in the rings so far
      if (least <= safe * safe) break;
    }
    return best;
  }

 private:
  Vec<int, 3> cell_of(const Vec3f& x) const {
    Vec<int, 3> c;
    for (int d = 0; d < 3; ++d) c[d] = std::clamp(static_cast<int>((x[d] - box_.low[d]) / cell_), 0, cells_[d] - 1);
    return c;
  }
  std::size_t number(const Vec<int, 3>& c) const {
    return (static_cast<std::size_t>(c[0]) * static_cast<std::size_t>(cells_[1]) + static_cast<std::size_t>(c[1])) *
               static_cast<std::size_t>(cells_[2]) +
           static_cast<std::size_t>(c[2]);
  }
  template <typename Visit>
  void visit_ring(const Vec<int, 3>& c, int ring, const Visit& visit) const {
    for (int x = std::max(0, c[0] - ring); x <= std::min(cells_[0] - 1, c[0] + ring); ++x)
      for (int y = std::max(0, c[1] - ring); y <= std::min(cells_[1] - 1, c[1] + ring); ++y)
        for (int z = std::max(0, c[2] - ring); z <= std::min(cells_[2] - 1, c[2] + ring); ++z)
          if (std::max({std::abs(x - c[0]), std::abs(y - c[1]), std::abs(z - c[2])}) == ring)
            for (const std::size_t i : members_[number({x, y, z})]) visit(i);
  }

  const std::vector<Vec3f>& points_;
  Box box_;
  float cell_ = 1;
  Vec<int, 3> cells_ = {1, 1, 1};
  std::vector<std::vector<std::size_t>> members_;
};

}  // namespace

Quadrature all_particles(int64_t count) {
  Quadrature q;
  q.particles.resize(static_cast<std::size_t>(count));
  std::iota(q.particles.begin(), q.particles.end(), 0);
  q.share.assign(q.particles.size(), 1.0);
  return q;
}

Quadrature thinned_particles(const std::vector<Vec3f>& reference, const std::vector<double>& volume, int step) {
  GRAUPEL_ASSERT(step >= 1 && reference.size() == volume.size());
  if (step == 1) return all_particles(static_cast<int64_t>(reference.size()));
  const std::vector<int32_t> order = curve_order(reference);
  Quadrature q;
  for (std::size_t i = static_cast<std::size_t>(step / 2); i < order.size(); i += static_cast<std::size_t>(step))
    q.particles.push_back(order[i]);
  if (q.particles.empty()) q.particles.push_back(order.at(order.size() / 2));
  std::sort(q.particles.begin(), q.particles.end());
  std::vector<Vec3f> kept;
  for (const int32_t p : q.particles) kept.push_back(reference[static_cast<std::size_t>(p)]);
  q.share.assign(kept.size(), 0.0);
  const NearestPoint nearest(kept);
  for (std::size_t p = 0; p < reference.size(); ++p) q.share[nearest(reference[p])] += volume[p];
  for (std::size_t i = 0; i < kept.size(); ++i) q.share[i] /= volume[static_cast<std::size_t>(q.particles[i])];
  return q;
}

}  // namespace graupel::rom
