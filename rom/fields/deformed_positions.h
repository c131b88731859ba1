// A deformation map at particles of the reference body, as fields are bound.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "rom/deformation/deformation.h"
#include "rom/fields/fields.h"

namespace graupel::rom {

/// X of some particles, from that of all [n, 3] [m].
inline std::vector<float> points_of(const std::vector<float>& reference, const std::vector<int32_t>& particles) {
  std::vector<float> points;
  points.reserve(3 * particles.size());
  for (const int32_t p : particles)
    points.insert(points.end(), reference.begin() + 3 * static_cast<std::ptrdiff_t>(p),
                  reference.begin() + 3 * static_cast<std::ptrdiff_t>(p) + 3);
  return points;
}

template <typename T>
class DeformedPositions final : public PointPositions<T> {
 public:
  DeformedPositions(const Deformation& map, const std::vector<float>& points, PointTables tables = PointTables::kept)
      : points_(bind_deformation<T>(map, points, tables)) {}
  void decode(const LatentState& state, T* position) override { points_->positions(state, position); }
  void decode(const LatentState& state, T* position, T* velocity) override {
    points_->decode(state, points_->all_tiles(), position, velocity, nullptr);
  }
  int64_t bytes() const override { return points_->bytes(); }

 private:
  std::unique_ptr<DeformationPoints<T>> points_;
};

}  // namespace graupel::rom
