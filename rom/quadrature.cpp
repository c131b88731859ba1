#include "rom/quadrature.h"

#include <algorithm>
#include <limits>
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

}  // namespace

std::vector<int32_t> Clusters::first_members() const {
  std::vector<int32_t> first(static_cast<std::size_t>(count), -1);
  for (std::size_t p = 0; p < of_particle.size(); ++p) {
    int32_t& member = first[static_cast<std::size_t>(of_particle[p])];
    if (member < 0) member = static_cast<int32_t>(p);
  }
  return first;
}

Clusters make_clusters(const std::vector<Vec3f>& reference, const std::vector<int32_t>& kind, int size) {
  GRAUPEL_ASSERT(size >= 1 && reference.size() == kind.size());
  Clusters clusters;
  clusters.of_particle.resize(reference.size());
  // Runs of particles of one kind along a curve that fills space.
  std::vector<int32_t> order = curve_order(reference);
  std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
    return kind[static_cast<std::size_t>(a)] < kind[static_cast<std::size_t>(b)];
  });
  int members = size;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto p = static_cast<std::size_t>(order[i]);
    if (members == size || kind[p] != kind[static_cast<std::size_t>(order[i - 1])]) {
      ++clusters.count;
      members = 0;
    }
    clusters.of_particle[p] = static_cast<int32_t>(clusters.count - 1);
    ++members;
  }
  return clusters;
}

}  // namespace graupel::rom
