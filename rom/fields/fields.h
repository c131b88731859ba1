// The fields of a reduced-order model over its reference body (NSF section 4): deformation g(X, q), Kirchhoff stress
// h(X, q, mu), affine velocity l(X, ..). Bound to the particles in use, so that what depends on X alone is prepared
// once.
#pragma once

#include <memory>
#include <vector>

#include "core/scene/fields.h"
#include "mpm/particles/particles.h"
#include "nn/weights.h"
#include "rom/cubature/quadrature.h"
#include "rom/projection/gauss_newton.h"
#include "rom/projection/latent_state.h"

namespace graupel::rom {

/// How the fields of a model with stresses are represented.
enum class FieldKind {
  factored,  ///< spatial modes times coefficients (rom/fields/factored_fields.h)
  mlp        ///< the paper's networks (rom/fields/mlp_fields.h)
};

constexpr auto enum_list(FieldKind) {
  return std::to_array<std::pair<const char*, FieldKind>>({{"factored", FieldKind::factored}, {"mlp", FieldKind::mlp}});
}

/// All three fields at some particles.
template <typename T>
class PointFields {
 public:
  virtual ~PointFields() = default;
  /// Fills position [m], velocity [m/s], stress [Pa] and affine velocity [1/s] of tiles of 16 slots: tile j of the
  /// particles is tile tiles[j] of the points that the fields are bound to. Where the stress follows the deformation
  /// (Fields), fills F and leaves the stress at zero. Leaves out fields whose `data` is null: F, or stress and affine
  /// velocity together.
  virtual void decode(const LatentState& state, const std::vector<int32_t>& tiles,
                      const mpm::ParticleView<T>& particles) = 0;
  virtual int64_t bytes() const = 0;
};

/// The deformation alone.
template <typename T>
class PointPositions {
 public:
  virtual ~PointPositions() = default;
  /// g(X_p, q) [m] into tiles of 16 slots x 3 (mpm/particles/particles.h).
  virtual void decode(const LatentState& state, T* position) = 0;
  /// The same, and dg/dq q' [m/s].
  virtual void decode(const LatentState& state, T* position, T* velocity) = 0;
  virtual int64_t bytes() const = 0;
};

class Fields {
 public:
  virtual ~Fields() = default;
  virtual int latents() const = 0;
  virtual int64_t particles() const = 0;  ///< of the reference body
  /// Whether points have F = dg/dX instead of a stress, which the material's law then gives.
  virtual bool stress_follows_deformation() const { return false; }
  /// Stress and affine velocity are zero at points where they are not known.
  virtual std::unique_ptr<PointFields<float>> bind_f32(const std::vector<int32_t>& points) const = 0;
  virtual std::unique_ptr<PointFields<double>> bind_f64(const std::vector<int32_t>& points) const = 0;
  virtual std::unique_ptr<PointPositions<float>> bind_positions_f32(const std::vector<int32_t>& points) const = 0;
  virtual std::unique_ptr<PointPositions<double>> bind_positions_f64(const std::vector<int32_t>& points) const = 0;
  virtual std::unique_ptr<SampleField> bind_samples(const std::vector<int32_t>& samples) const = 0;
  /// The deformation at any material points X [n, 3] [m], for output; null for fields that know particles alone.
  virtual std::unique_ptr<PointPositions<float>> bind_any_points(const std::vector<float>&) const { return nullptr; }

  /// How they are represented, a word: `field` in the metadata of a weights file.
  virtual const char* kind() const = 0;
  /// Fields for clusters of particles as integration points, which have their means of stress and affine velocity.
  virtual std::shared_ptr<const Fields> with_clusters(const Clusters& clusters) const = 0;
  /// Adds the fields' tensors; `modes` is the type of the large ones, where there are such.
  virtual void store(nn::Weights& weights, nn::DType modes) const = 0;
};

template <typename T>
std::unique_ptr<PointFields<T>> bind_fields(const Fields& fields, const std::vector<int32_t>& points) {
  if constexpr (sizeof(T) == sizeof(float))
    return fields.bind_f32(points);
  else
    return fields.bind_f64(points);
}
template <typename T>
std::unique_ptr<PointPositions<T>> bind_positions(const Fields& fields, const std::vector<int32_t>& points) {
  if constexpr (sizeof(T) == sizeof(float))
    return fields.bind_positions_f32(points);
  else
    return fields.bind_positions_f64(points);
}

}  // namespace graupel::rom
