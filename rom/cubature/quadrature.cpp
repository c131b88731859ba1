#include "rom/cubature/quadrature.h"

#include <algorithm>
#include <map>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::rom {

namespace {

using Iterator = std::vector<int32_t>::iterator;

/// Axis along which some particles reach furthest.
int longest_axis(const std::vector<Vec3f>& reference, Iterator begin, Iterator end) {
  Vec3f low = reference[static_cast<std::size_t>(*begin)], high = low;
  for (Iterator p = begin; p != end; ++p)
    for (int d = 0; d < 3; ++d) {
      low[d] = std::min(low[d], reference[static_cast<std::size_t>(*p)][d]);
      high[d] = std::max(high[d], reference[static_cast<std::size_t>(*p)][d]);
    }
  const Vec3f size = high - low;
  return size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
}

/// Halves the particles across their longest axis until no more than `size` are left together.
void divide(const std::vector<Vec3f>& reference, int size, Iterator begin, Iterator end, Clusters& clusters) {
  const std::ptrdiff_t count = end - begin;
  if (count <= size) {
    for (Iterator p = begin; p != end; ++p)
      clusters.of_particle[static_cast<std::size_t>(*p)] = static_cast<int32_t>(clusters.count);
    ++clusters.count;
    return;
  }
  const int axis = longest_axis(reference, begin, end);
  // Whole clusters on the lower side.
  const std::ptrdiff_t whole = (count + size - 1) / size, lower = count * (whole / 2) / whole;
  std::nth_element(begin, begin + lower, end, [&](int32_t a, int32_t b) {
    const float x = reference[static_cast<std::size_t>(a)][axis], y = reference[static_cast<std::size_t>(b)][axis];
    return x < y || (x == y && a < b);
  });
  divide(reference, size, begin, begin + lower, clusters);
  divide(reference, size, begin + lower, end, clusters);
}

}  // namespace

std::vector<int32_t> Clusters::representatives() const {
  if (!points.empty()) return points;
  std::vector<int32_t> chosen(static_cast<std::size_t>(count), -1);
  std::vector<uint32_t> least(chosen.size());
  const Random random(0, RandomPurpose::sample_particle, 1);
  for (std::size_t p = 0; p < of_particle.size(); ++p) {
    const auto cluster = static_cast<std::size_t>(of_particle[p]);
    const uint32_t lot = random.words(p).v[0];
    if (chosen[cluster] >= 0 && least[cluster] <= lot) continue;
    chosen[cluster] = static_cast<int32_t>(p);
    least[cluster] = lot;
  }
  return chosen;
}

Clusters make_clusters(const std::vector<Vec3f>& reference, const std::vector<int32_t>& kind, int size) {
  GRAUPEL_ASSERT(size >= 1 && reference.size() == kind.size());
  Clusters clusters;
  clusters.of_particle.resize(reference.size());
  std::map<int32_t, std::vector<int32_t>> by_kind;
  for (std::size_t p = 0; p < kind.size(); ++p) by_kind[kind[p]].push_back(static_cast<int32_t>(p));
  for (auto& [unused, members] : by_kind) divide(reference, size, members.begin(), members.end(), clusters);
  return clusters;
}

}  // namespace graupel::rom
