// The modes of a field at the particles in use, in tiles of 16 like mpm's particle arrays, so that a field is written
// where the transfers read it. A step reads them all once: they are kept in 16 bits where the weights file had no more.
#pragma once

#include <cstdint>
#include <vector>

#include "core/parallel/buffer.h"
#include "rom/fields/mode_table.h"

namespace graupel::rom {

/// Mean and basis of chosen rows: mean of component c of slot s at (s / 16 * components + c) * 16 + s % 16, mode k at
/// ((s / 16 * modes + k) * components + c) * 16 + s % 16.
template <typename T>
class TiledModes {
 public:
  TiledModes() = default;
  /// One slot for each point, zero where the table has no row; `order[c]` is the component that stands at place c of
  /// the result. 3, 6 or 9 components.
  void assign(const ModeTable& table, const std::vector<int32_t>& points, const std::vector<int>& order);

  int64_t tiles() const { return tiles_; }
  int modes() const { return modes_; }
  /// The coefficients a, and a', that evaluations use from now on, [modes].
  void set_coefficients(const double* a);
  void set_rates(const double* a_rate);
  /// Tile t of mean + sum_k W_k a_k, [components, 16].
  void evaluate(int64_t t, T* values) const { evaluate(t, values, nullptr); }
  /// The same, and of rates = sum_k W_k a'_k.
  void evaluate(int64_t t, T* values, T* rates) const;
  int64_t bytes() const {
    return static_cast<int64_t>((mean_.size() + basis_.size()) * sizeof(T) + half_.size() * sizeof(uint16_t));
  }

 private:
  template <int C>
  void evaluate_tile(int64_t t, T* values, T* rates) const;

  int64_t tiles_ = 0;
  int components_ = 0, modes_ = 0;
  Buffer<T> mean_, basis_;
  Buffer<uint16_t> half_;          ///< instead of basis_, over the modes' amplitudes
  std::vector<double> amplitude_;  ///< of half_; ones for basis_
  std::vector<T> a_, rate_;        ///< coefficients times amplitudes
};

extern template class TiledModes<float>;
extern template class TiledModes<double>;

}  // namespace graupel::rom
