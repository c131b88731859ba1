#include "io/surface/near_particles.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace graupel::io {

namespace {

/// 21 bits an axis: cells that are 2^21 apart share a key, and the distance tells their particles apart.
uint64_t cell_key(int64_t x, int64_t y, int64_t z) {
  constexpr uint64_t mask = (1u << 21) - 1;
  return (static_cast<uint64_t>(x) & mask) << 42 | (static_cast<uint64_t>(y) & mask) << 21 |
         (static_cast<uint64_t>(z) & mask);
}

}  // namespace

NearParticles::NearParticles(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity, double radius)
    : radius_(radius) {
  std::vector<uint64_t> key(position.size());
  for (std::size_t i = 0; i < position.size(); ++i)
    key[i] = cell_key(cell_along(position[i][0]), cell_along(position[i][1]), cell_along(position[i][2]));
  std::vector<uint32_t> order(position.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key[a] < key[b]; });
  position_.reserve(order.size());
  velocity_.reserve(velocity.size());
  for (const uint32_t i : order) {
    const auto place = static_cast<uint32_t>(position_.size());
    Range& range = cells_.try_emplace(key[i], Range{place, place}).first->second;
    range.end = place + 1;
    position_.push_back(position[i]);
    if (!velocity.empty()) velocity_.push_back(velocity[i]);
  }
}

int64_t NearParticles::cell_along(float x) const { return static_cast<int64_t>(std::floor(x / radius_)); }

template <typename Visitor>
void NearParticles::for_each(const Vec3f& place, const Visitor& visit) const {
  const int64_t x = cell_along(place[0]), y = cell_along(place[1]), z = cell_along(place[2]);
  for (int64_t i = x - 1; i <= x + 1; ++i)
    for (int64_t j = y - 1; j <= y + 1; ++j)
      for (int64_t k = z - 1; k <= z + 1; ++k) {
        const auto cell = cells_.find(cell_key(i, j, k));
        if (cell == cells_.end()) continue;
        for (uint32_t p = cell->second.first; p < cell->second.end; ++p) {
          const double nearness = 1 - norm2((place - position_[p]).cast<double>()) / (radius_ * radius_);
          if (nearness > 0 && !visit(p, nearness)) return;
        }
      }
}

int NearParticles::count(const Vec3f& place, int most) const {
  int found = 0;
  for_each(place, [&](uint32_t, double) { return ++found < most; });
  return found;
}

Vec3f NearParticles::velocity(const Vec3f& place) const {
  double weights = 0;
  Vec3d sum = Vec3d::zero();
  for_each(place, [&](uint32_t p, double nearness) {
    const double weight = nearness * nearness * nearness;
    weights += weight;
    sum += weight * velocity_[p].cast<double>();
    return true;
  });
  return weights > 0 ? (sum * (1 / weights)).cast<float>() : Vec3f::zero();
}

}  // namespace graupel::io
