// The deformation map x = g(X, q) of a reference body at any of its material points X (CROM eq. 19; NSF eq. 5), with
// its exact derivatives. Bound to points once, so that what depends on X alone is prepared once.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/scene/fields.h"
#include "nn/weights.h"
#include "rom/projection/gauss_newton.h"
#include "rom/projection/latent_state.h"

namespace graupel::rom {

/// g at some points, in tiles of 16 (mpm/particles/particles.h).
template <typename T>
class DeformationPoints {
 public:
  virtual ~DeformationPoints() = default;
  /// Tile j of the results is tile tiles[j] of the points: position g(X, q) [m]; velocity [m/s], which is dg/dq q', or
  /// the change over the state's last step where there was one; and, unless they are null, F = dg/dX row by row.
  virtual void decode(const LatentState& state, const std::vector<int32_t>& tiles, T* position, T* velocity,
                      T* gradient) = 0;
  /// Other points X [n, 3] [m] in place of those so far.
  virtual void set_points(const std::vector<float>& points) = 0;
  /// Positions of all points.
  virtual void positions(const LatentState& state, T* position) = 0;
  virtual const std::vector<int32_t>& all_tiles() const = 0;
  virtual int64_t bytes() const = 0;
};

/// How a map is represented.
enum class DeformationKind {
  mlp,   ///< a network (rom/deformation/mlp_deformation.h)
  modes  ///< a linear subspace (rom/deformation/mode_deformation.h)
};

constexpr auto enum_list(DeformationKind) {
  return std::to_array<std::pair<const char*, DeformationKind>>(
      {{"mlp", DeformationKind::mlp}, {"modes", DeformationKind::modes}});
}

/// What is kept of points between decodings.
enum class PointTables {
  kept,  ///< all that depends on X alone: for points that are decoded in every step
  none   ///< X: for points that change, and for very many that are decoded now and then
};

class Deformation {
 public:
  virtual ~Deformation() = default;
  virtual DeformationKind kind() const = 0;
  virtual int latents() const = 0;
  /// `points` X [n, 3] [m], any of the body. The deformation must outlive what is bound to it.
  virtual std::unique_ptr<DeformationPoints<float>> bind_f32(const std::vector<float>& points,
                                                             PointTables tables) const = 0;
  virtual std::unique_ptr<DeformationPoints<double>> bind_f64(const std::vector<float>& points,
                                                              PointTables tables) const = 0;
  /// For inversions: g and dg/dq in f64.
  virtual std::unique_ptr<SampleField> bind_samples(const std::vector<float>& points) const = 0;
  /// Adds the map's tensors.
  virtual void store(nn::Weights& weights) const = 0;
};

template <typename T>
std::unique_ptr<DeformationPoints<T>> bind_deformation(const Deformation& map, const std::vector<float>& points,
                                                       PointTables tables = PointTables::kept) {
  if constexpr (sizeof(T) == sizeof(float))
    return map.bind_f32(points, tables);
  else
    return map.bind_f64(points, tables);
}

}  // namespace graupel::rom
