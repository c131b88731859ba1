// The spatial part of a factored field at the training particles: f(X_p) = mean_p + sum_k W_pk a_k, and the same for
// the particles in use, in tiles of 16 like mpm's particle arrays, so that a field is written where the transfers read
// it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/buffer.h"
#include "mpm/particles.h"
#include "nn/weights.h"
#include "rom/quadrature.h"

namespace graupel::rom {

/// As stored. A field may be kept at some of the points only (stress and affine velocity at the integration points).
struct ModeTable {
  int components = 0, modes = 0;
  std::vector<int32_t> points;  ///< of every row, ascending
  std::vector<float> mean;      ///< [rows, components]
  std::vector<float> basis;     ///< [rows, components, modes]

  int64_t rows() const { return static_cast<int64_t>(points.size()); }
  /// Row of a point, or -1.
  int64_t row_of(int32_t point) const;
  /// Rows for the clusters' representatives, each the mean over the particles of its cluster. The table must have all
  /// of these.
  ModeTable averaged(const Clusters& clusters) const;

  /// Tensors <prefix>.points i32 [rows], .mean f32 [rows, components], .basis [rows, components, modes] (f16 or f32,
  /// each mode over its largest value) and .amplitude f32 [modes]. Throws InputError as nn::Weights::get.
  static ModeTable load(const nn::Weights& weights, const std::string& prefix, int components);
  void store(nn::Weights& weights, const std::string& prefix, nn::DType dtype) const;
};

/// Mean and basis of chosen rows in tiles: value c, mode k of slot s at ((s / 16) * components + c) * modes + k) * 16 +
/// s % 16.
template <typename T>
class TiledModes {
 public:
  TiledModes() = default;
  /// One slot for each point, zero where the table has no row; `order[c]` is the component that stands at place c of
  /// the result.
  void assign(const ModeTable& table, const std::vector<int32_t>& points, const std::vector<int>& order);

  int64_t slots() const { return slots_; }
  int modes() const { return modes_; }
  /// mean + sum_k W_k a_k, into tiles of 16 slots x components.
  void evaluate(const T* a, T* values) const;
  /// The same, and rates = sum_k W_k a'_k.
  void evaluate(const T* a, const T* a_rate, T* values, T* rates) const;
  int64_t bytes() const { return static_cast<int64_t>((mean_.size() + basis_.size()) * sizeof(T)); }

 private:
  int64_t slots_ = 0;
  int components_ = 0, modes_ = 0;
  Buffer<T> mean_, basis_;
};

extern template class TiledModes<float>;
extern template class TiledModes<double>;

}  // namespace graupel::rom
