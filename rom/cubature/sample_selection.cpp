#include "rom/cubature/sample_selection.h"

#include <algorithm>
#include <map>
#include <set>

#include "core/math/random.h"

namespace graupel::rom {

namespace {

std::vector<int32_t> random_samples(std::vector<int32_t> candidates, std::size_t count, uint64_t seed) {
  const Random random(seed, RandomPurpose::sample_particle);
  for (std::size_t i = candidates.size() - 1; i > 0; --i)
    std::swap(candidates[i], candidates[random.integer(i, 0, static_cast<uint32_t>(i + 1))]);
  candidates.resize(count);
  return candidates;
}

std::vector<int32_t> spread_samples(const std::vector<int32_t>& candidates, std::size_t count) {
  std::vector<int32_t> samples;
  for (std::size_t i = 0; i < count; ++i) samples.push_back(candidates[i * candidates.size() / count]);
  return samples;
}

std::vector<int32_t> patched_samples(const std::vector<int32_t>& candidates, std::size_t count) {
  constexpr std::size_t patch = 16;
  const std::size_t patches = (count + patch - 1) / patch;
  std::vector<int32_t> samples;
  for (std::size_t i = 0; i < patches; ++i) {
    // The patch in the middle of its part of the order.
    const std::size_t part = candidates.size() / patches, size = std::min(patch, count - i * patch),
                      first = i * candidates.size() / patches + (part - std::min(part, size)) / 2;
    for (std::size_t j = 0; j < size; ++j) samples.push_back(candidates[first + j]);
  }
  return samples;
}

}  // namespace

std::vector<int32_t> points_within(const std::vector<int32_t>& points, const std::vector<float>& reference,
                                   const Vec3d& low, const Vec3d& high) {
  std::vector<int32_t> inside;
  for (const int32_t point : points) {
    bool is_inside = true;
    for (int d = 0; d < 3; ++d) {
      const auto x = static_cast<double>(reference[static_cast<std::size_t>(3 * point + d)]);
      is_inside = is_inside && x >= low[d] && x <= high[d];
    }
    if (is_inside) inside.push_back(point);
  }
  return inside;
}

std::vector<int32_t> choose_samples(SampleRule rule, const std::vector<int32_t>& candidates, int64_t count,
                                    uint64_t seed) {
  const auto n = std::min(static_cast<std::size_t>(count), candidates.size());
  std::vector<int32_t> samples = rule == SampleRule::random   ? random_samples(candidates, n, seed)
                                 : rule == SampleRule::spread ? spread_samples(candidates, n)
                                                              : patched_samples(candidates, n);
  std::sort(samples.begin(), samples.end());
  return samples;
}

std::vector<int32_t> with_boundary_samples(std::vector<int32_t> samples, const std::vector<int32_t>& script,
                                           int64_t least) {
  const std::set<int32_t> taken(samples.begin(), samples.end());
  std::map<int32_t, int64_t> count;
  std::map<int32_t, std::vector<int32_t>> others;  // of each script
  for (std::size_t p = 0; p < script.size(); ++p) {
    if (script[p] < 0) continue;
    const auto particle = static_cast<int32_t>(p);
    if (taken.contains(particle))
      ++count[script[p]];
    else
      others[script[p]].push_back(particle);
  }
  for (const auto& [number, particles] : others) {
    const int64_t all = static_cast<int64_t>(particles.size()), missing = std::min(all, least - count[number]);
    for (int64_t i = 0; i < missing; ++i) samples.push_back(particles[static_cast<std::size_t>(i * all / missing)]);
  }
  return samples;
}

}  // namespace graupel::rom
