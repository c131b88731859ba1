#include "rom/interpolation/mls_interpolation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/math/random.h"
#include "core/parallel/parallel_for.h"
#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "rom/interpolation/mls_tile.h"

namespace graupel::rom {

using mpm::tile;

namespace {

constexpr double radius_spacings = 2.25;
constexpr double furthest_spacings = 1.5;  ///< of a point to the nearest particle

/// Particles sorted by the cells of a lattice as wide as the radius.
class MlsCellList {
 public:
  MlsCellList(const MlsParticles& particles, double radius)
      : particles_(particles), width_(static_cast<float>(radius)) {
    low_ = particles.reference.front();
    Vec3f high = low_;
    for (const Vec3f& x : particles.reference)
      for (int d = 0; d < 3; ++d) {
        low_[d] = std::min(low_[d], x[d]);
        high[d] = std::max(high[d], x[d]);
      }
    std::size_t cells = 1;
    for (int d = 0; d < 3; ++d) {
      size_[d] = 1 + static_cast<int>((high[d] - low_[d]) / width_);
      cells *= static_cast<std::size_t>(size_[d]);
    }
    first_.assign(cells + 1, 0);
    for (const Vec3f& x : particles.reference) ++first_[number(cell(x)) + 1];
    for (std::size_t c = 0; c < cells; ++c) first_[c + 1] += first_[c];
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    sorted_.resize(particles.reference.size());
    for (std::size_t p = 0; p < sorted_.size(); ++p)
      sorted_[next[number(cell(particles.reference[p]))]++] = static_cast<int32_t>(p);
  }

  /// Calls visit(particle) for all in cells that a box, widened by the radius, meets.
  template <typename Visit>
  void around(const Vec3f& low, const Vec3f& high, const Visit& visit) const {
    const Vec3f margin{width_, width_, width_};
    const Vec<int, 3> begin = cell(low - margin), end = cell(high + margin);
    for (int x = begin[0]; x <= end[0]; ++x)
      for (int y = begin[1]; y <= end[1]; ++y)
        for (std::size_t i = first_[number({x, y, begin[2]})]; i < first_[number({x, y, end[2]}) + 1]; ++i)
          visit(sorted_[i]);
  }

 private:
  Vec<int, 3> cell(const Vec3f& x) const {
    Vec<int, 3> c;
    for (int d = 0; d < 3; ++d)
      c[d] = static_cast<int>(std::clamp((x[d] - low_[d]) / width_, 0.0f, static_cast<float>(size_[d] - 1)));
    return c;
  }
  std::size_t number(const Vec<int, 3>& c) const {
    return (static_cast<std::size_t>(c[0]) * static_cast<std::size_t>(size_[1]) + static_cast<std::size_t>(c[1])) *
               static_cast<std::size_t>(size_[2]) +
           static_cast<std::size_t>(c[2]);
  }

  const MlsParticles& particles_;
  float width_;
  Vec3f low_;
  Vec<int, 3> size_;
  std::vector<std::size_t> first_;
  std::vector<int32_t> sorted_;
};

/// Finds the neighbours of one tile after the other.
class TileSearch {
 public:
  TileSearch(const MlsParticles& particles, const ReferencePoints& points, const MlsCellList& cells, double radius)
      : particles_(particles), points_(points), cells_(cells), radius_(static_cast<float>(radius)) {}

  void append(int64_t t, std::vector<int32_t>& list) {
    const auto begin = static_cast<std::size_t>(t * tile);
    const std::size_t end = std::min(begin + static_cast<std::size_t>(tile), points_.position.size()),
                      old = list.size();
    for (std::size_t l = begin; l < end;) l = append_run(l, end, list);
    if (runs_ > 1) {
      std::sort(list.begin() + static_cast<std::ptrdiff_t>(old), list.end());
      list.erase(std::unique(list.begin() + static_cast<std::ptrdiff_t>(old), list.end()), list.end());
    }
    runs_ = 0;
  }

 private:
  /// Points from l on whose box is no wider than the radius; returns the first one that is not among them.
  std::size_t append_run(std::size_t l, std::size_t end, std::vector<int32_t>& list) {
    Vec3f low = points_.position[l], high = low;
    std::size_t stop = l;
    for (; stop < end; ++stop) {
      Vec3f wider_low = low, wider_high = high;
      bool fits = true;
      for (int d = 0; d < 3; ++d) {
        wider_low[d] = std::min(low[d], points_.position[stop][d]);
        wider_high[d] = std::max(high[d], points_.position[stop][d]);
        fits = fits && wider_high[d] - wider_low[d] <= radius_;
      }
      if (!fits) break;
      low = wider_low;
      high = wider_high;
    }
    std::vector<float> least(stop - l, INFINITY);
    cells_.around(low, high, [&](int32_t p) {
      const Vec3f& x = particles_.reference[static_cast<std::size_t>(p)];
      bool near = false;
      for (std::size_t i = l; i < stop; ++i) {
        if (points_.kind[i] != particles_.kind[static_cast<std::size_t>(p)]) continue;
        const float distance2 = norm2(points_.position[i] - x);
        least[i - l] = std::min(least[i - l], distance2);
        near = near || distance2 < radius_ * radius_;
      }
      if (near) list.push_back(p);
    });
    for (std::size_t i = l; i < stop; ++i) check(i, least[i - l]);
    ++runs_;
    return stop;
  }

  void check(std::size_t i, float distance2) const {
    const double limit = furthest_spacings * particles_.spacing, distance = std::sqrt(static_cast<double>(distance2));
    if (distance <= limit) return;
    const Vec3f& x = points_.position[i];
    throw ConfigError(
        fmt::format("point {} at ({:.6g}, {:.6g}, {:.6g}) m lies outside of the reference body ({} from the nearest "
                    "particle of its kind, allowed {:.3g} m). Choose points inside of the body",
                    i, x[0], x[1], x[2], distance < 1e18 ? fmt::format("{:.3g} m", distance) : "far", limit));
  }

  const MlsParticles& particles_;
  const ReferencePoints& points_;
  const MlsCellList& cells_;
  float radius_;
  int runs_ = 0;
};

}  // namespace

MlsNeighbours::MlsNeighbours(const MlsParticles& particles, const ReferencePoints& points)
    : radius_(radius_spacings * particles.spacing) {
  GRAUPEL_ASSERT(!particles.reference.empty() && particles.spacing > 0);
  GRAUPEL_ASSERT(points.kind.size() == points.position.size());
  const MlsCellList cells(particles, radius_);
  const int64_t tiles = mpm::padded_to_tile(static_cast<int64_t>(points.position.size())) / tile;
  batches_.resize(static_cast<std::size_t>((tiles + batch_tiles - 1) / batch_tiles));
  for_each_pool_task(batches_.size(), [&](std::size_t b) {
    Batch& batch = batches_[b];
    TileSearch one(particles, points, cells, radius_);
    batch.first = {0};
    const int64_t begin = static_cast<int64_t>(b) * batch_tiles;
    for (int64_t t = begin; t < std::min(tiles, begin + batch_tiles); ++t) {
      one.append(t, batch.list);
      batch.first.push_back(batch.list.size());
    }
    batch.list.shrink_to_fit();
  });
}

int64_t MlsNeighbours::bytes() const {
  std::size_t sum = 0;
  for (const Batch& b : batches_) sum += b.list.size() * sizeof(int32_t) + b.first.size() * sizeof(std::size_t);
  return static_cast<int64_t>(sum);
}

template <typename T>
MlsMotion<T>::MlsMotion(MlsParticles particles, ReferencePoints points)
    : particles_(std::move(particles)), points_(std::move(points)), neighbours_(particles_, points_) {
  const std::size_t n = particles_.numbers.size();
  GRAUPEL_ASSERT(particles_.reference.size() == n && particles_.kind.size() == n);
  records_.assign(n * trunk_record, T(0));
}

template <typename T>
void MlsMotion<T>::take(const T* position, const T* velocity) {
  const auto fill = [&](int64_t p) {
    T* record = records_.data() + p * trunk_record;
    const T *x = mpm::TiledView<const T, 3>{position}.at(p),
            *v = velocity ? mpm::TiledView<const T, 3>{velocity}.at(p) : nullptr;
    for (int d = 0; d < 3; ++d) {
      record[d] = static_cast<T>(particles_.reference[static_cast<std::size_t>(p)][d]);
      record[3 + d] = x[d * tile] - record[d];
      record[6 + d] = v ? v[d * tile] : T(0);
    }
  };
  parallel_for_cpu(static_cast<int64_t>(particles_.numbers.size()), fill, Grain{4096});
}

template <typename T>
void MlsMotion<T>::carry(T* position, T* velocity, T* gradient) const {
  constexpr int64_t tiles_at_once = 64;
  const auto n = static_cast<int64_t>(points_.position.size());
  const int64_t tiles = mpm::padded_to_tile(n) / tile;
  const auto some_tiles = [&](int64_t run) {
    MlsTile<T> at(neighbours_.radius());
    for (int64_t t = run * tiles_at_once; t < std::min(tiles, (run + 1) * tiles_at_once); ++t) {
      for (int64_t l = 0; l < tile; ++l) {
        const auto slot = static_cast<std::size_t>(std::min(t * tile + l, n - 1));
        at.place(l, points_.position[slot], points_.kind[slot]);
      }
      at.fit({neighbours_.begin(t), neighbours_.end(t), records_.data(), particles_.kind.data()});
      at.positions(position + t * 3 * tile);
      if (velocity) at.velocities(velocity + t * 3 * tile);
      if (gradient) at.gradients(gradient + t * 9 * tile);
    }
  };
  parallel_for_cpu((tiles + tiles_at_once - 1) / tiles_at_once, some_tiles, Grain{1});
}

template <typename T>
int64_t MlsMotion<T>::bytes() const {
  return neighbours_.bytes() + static_cast<int64_t>(records_.size() * sizeof(T) +
                                                    points_.position.size() * (sizeof(Vec3f) + sizeof(int32_t)));
}

template <typename T>
MlsPositions<T>::MlsPositions(const Fields& fields, MlsParticles particles, ReferencePoints points)
    : motion_(std::move(particles), std::move(points)),
      at_particles_(bind_positions<T>(fields, motion_.particles().numbers)) {
  position_.resize(
      static_cast<std::size_t>(3 * mpm::padded_to_tile(static_cast<int64_t>(motion_.particles().numbers.size()))));
  velocity_.resize(position_.size());
}

template <typename T>
void MlsPositions<T>::decode(const LatentState& state, T* position) {
  at_particles_->decode(state, position_.data());
  motion_.take(position_.data(), nullptr);
  motion_.carry(position, nullptr, nullptr);
}

template <typename T>
void MlsPositions<T>::decode(const LatentState& state, T* position, T* velocity) {
  at_particles_->decode(state, position_.data(), velocity_.data());
  motion_.take(position_.data(), velocity_.data());
  motion_.carry(position, velocity, nullptr);
}

template <typename T>
void MlsPositions<T>::decode_with_gradient(const LatentState& state, T* position, T* gradient) {
  at_particles_->decode(state, position_.data());
  motion_.take(position_.data(), nullptr);
  motion_.carry(position, nullptr, gradient);
}

template <typename T>
int64_t MlsPositions<T>::bytes() const {
  return motion_.bytes() + at_particles_->bytes() +
         static_cast<int64_t>((position_.size() + velocity_.size()) * sizeof(T));
}

template class MlsMotion<float>;
template class MlsMotion<double>;
template class MlsPositions<float>;
template class MlsPositions<double>;

ReferencePoints refined_points(const MlsParticles& particles, const std::vector<double>& side, int times,
                               int dimensions, uint64_t seed) {
  const auto n = static_cast<int64_t>(particles.reference.size());
  GRAUPEL_ASSERT(static_cast<int64_t>(side.size()) == n && times >= 1);
  int width = 1;  // parts along an axis
  const auto parts = [&] { return static_cast<int64_t>(width) * width * (dimensions == 3 ? width : 1); };
  while (parts() < times) ++width;
  const Random random(seed, RandomPurpose::sample_particle, 2);
  ReferencePoints points;
  points.position.resize(static_cast<std::size_t>(n * times));
  points.kind.resize(points.position.size());
  const auto fill = [&](int64_t p) {
    for (int64_t k = 0; k < times; ++k) {
      const auto i = static_cast<std::size_t>(p * times + k);
      // Spread over all parts where there are more than points, without skipping the same ones every time.
      int64_t part = std::min(parts() - 1, static_cast<int64_t>((static_cast<double>(k) + random.uniform(i, 3)) *
                                                                static_cast<double>(parts()) / times));
      Vec3f x = particles.reference[static_cast<std::size_t>(p)];
      for (int d = 0; d < dimensions; ++d, part /= width) {
        const double place = (static_cast<double>(part % width) + random.uniform(i, d)) / width - 0.5;
        x[d] += static_cast<float>(side[static_cast<std::size_t>(p)] * place);
      }
      points.position[i] = x;
      points.kind[i] = particles.kind[static_cast<std::size_t>(p)];
    }
  };
  parallel_for_cpu(n, fill, Grain{64});
  return points;
}

}  // namespace graupel::rom
