// The spatial part of a factored field at the training particles, as weights files keep it:
// f(X_p) = mean_p + sum_k W_pk a_k.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mpm/particles/particles.h"
#include "nn/weights.h"
#include "rom/cubature/quadrature.h"

namespace graupel::rom {

/// How exact the basis is: f32, or f16 over each mode's largest value.
enum class ModePrecision { full, half };

/// As stored. A field may be kept at some of the points only (stress and affine velocity at the integration points).
struct ModeTable {
  int components = 0, modes = 0;
  std::vector<int32_t> points;  ///< of every row, ascending
  std::vector<float> mean;      ///< [rows, components]
  std::vector<float> basis;     ///< [rows, components, modes]
  ModePrecision precision = ModePrecision::full;

  int64_t rows() const { return static_cast<int64_t>(points.size()); }
  /// Largest value of every mode, 1 for one that is zero, [modes].
  std::vector<float> amplitude() const;
  /// Row of a point, or -1.
  int64_t row_of(int32_t point) const;
  /// Rows for the clusters' representatives, each the mean over the particles of its cluster. The table must have all
  /// of these.
  ModeTable averaged(const Clusters& clusters) const;

  /// Tensors <prefix>.points i32 [rows] (left out where they are 0, 1, 2 ..), .mean f32 [rows, components], .basis
  /// [rows, components, modes] (f16 or f32, each mode over its largest value) and .amplitude f32 [modes]. Throws
  /// InputError as nn::Weights::get.
  static ModeTable load(const nn::Weights& weights, const std::string& prefix, int components);
  void store(nn::Weights& weights, const std::string& prefix, nn::DType dtype) const;
};

}  // namespace graupel::rom
