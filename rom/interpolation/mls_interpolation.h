// Fields of a reduced model between its particles: at any point X of the reference body by moving least squares with
// linear reproduction over the particles near it (Lancaster and Salkauskas 1981),
//   f(X) = a,  (a, G) = argmin sum_j w(|X_j - X| / h) |f_j - a - G (X_j - X)|^2,  w(r) = (1 - r^2)^2, h = 2.25
//   spacings.
// Exact for linear fields, once differentiable. It is linear in f, so that interpolating what was decoded at the
// particles is the same as interpolating modes, and the points need none of their own.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/math/vec.h"
#include "rom/fields/fields.h"

namespace graupel::rom {

/// Particles between which the fields are taken.
struct MlsParticles {
  std::vector<int32_t> numbers;  ///< in the fields
  std::vector<Vec3f> reference;  ///< X [m]
  std::vector<int32_t> kind;     ///< material and script: a point takes from particles of its own, so cuts stay sharp
  double spacing = 0;            ///< of the particles, the largest where it differs [m]
};

/// Points of the reference body, particles or not. Neighbours in this order should lie near each other.
struct ReferencePoints {
  std::vector<Vec3f> position;  ///< X [m]
  std::vector<int32_t> kind;
};

/// Neighbours of the points, 16 points (a tile) together.
class MlsNeighbours {
 public:
  /// Throws ConfigError for points that lie further than 1.5 spacings from every particle of their kind: the body ends
  /// half a spacing behind its particles.
  MlsNeighbours(const MlsParticles& particles, const ReferencePoints& points);

  /// Particles within the radius of a point of the tile, as indices into MlsParticles.
  const int32_t* begin(int64_t tile) const { return batch(tile).list.data() + batch(tile).first[in_batch(tile)]; }
  const int32_t* end(int64_t tile) const { return batch(tile).list.data() + batch(tile).first[in_batch(tile) + 1]; }
  double radius() const { return radius_; }  ///< h [m]
  int64_t bytes() const;

 private:
  static constexpr int64_t batch_tiles = 256;
  struct Batch {
    std::vector<int32_t> list;
    std::vector<std::size_t> first;
  };
  const Batch& batch(int64_t tile) const { return batches_[static_cast<std::size_t>(tile / batch_tiles)]; }
  static std::size_t in_batch(int64_t tile) { return static_cast<std::size_t>(tile % batch_tiles); }

  double radius_;
  std::vector<Batch> batches_;
};

/// Motions of the particles, carried to points of the reference body.
template <typename T>
class MlsMotion {
 public:
  MlsMotion(MlsParticles particles, ReferencePoints points);
  /// Takes positions x [m] and, unless they are null, velocities [m/s] of the particles, in tiles of 16 slots x 3.
  void take(const T* position, const T* velocity);
  /// At the points, in tiles: position, and unless they are null velocity and F = dx/dX row by row.
  void carry(T* position, T* velocity, T* gradient) const;
  const MlsParticles& particles() const { return particles_; }
  int64_t bytes() const;

 private:
  MlsParticles particles_;
  ReferencePoints points_;
  MlsNeighbours neighbours_;
  std::vector<T> records_;  ///< of every particle: X, x - X [m], v [m/s]
};

extern template class MlsMotion<float>;
extern template class MlsMotion<double>;

/// The deformation at points of the reference body.
template <typename T>
class MlsPositions final : public PointPositions<T> {
 public:
  MlsPositions(const Fields& fields, MlsParticles particles, ReferencePoints points);
  void decode(const LatentState& state, T* position) override;
  void decode(const LatentState& state, T* position, T* velocity) override;
  /// Positions [m], and F = dg/dX row by row into tiles of 16 slots x 9.
  void decode_with_gradient(const LatentState& state, T* position, T* gradient);
  int64_t bytes() const override;

 private:
  MlsMotion<T> motion_;
  std::unique_ptr<PointPositions<T>> at_particles_;
  std::vector<T> position_, velocity_;  ///< of the particles, tiled
};

extern template class MlsPositions<float>;
extern template class MlsPositions<double>;

/// `times` points in the volume of every particle, a cube of `side` [m] about it (a square in a plane): one at random
/// in each of as many parts of equal size. Depends on the seed, the particle and the point's number alone.
ReferencePoints refined_points(const MlsParticles& particles, const std::vector<double>& side, int times,
                               int dimensions, uint64_t seed);

}  // namespace graupel::rom
