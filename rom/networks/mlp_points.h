// A multilayer perceptron at fixed points X for changing (q, mu). The part of the first layer that sees q and mu is the
// same for all points, so a point's own input is X alone.
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "nn/linear.h"
#include "rom/networks/mlp.h"

namespace graupel::rom {

/// f32: nn/'s matrix kernel over blocks of points whose activations stay in the second-level cache. f64: Eigen.
template <typename T>
class MlpPoints {
 public:
  /// `points` [n, 3] [m]; `order[c]` is the output that stands at place c of the tiles. `mlp` must outlive this.
  MlpPoints(const Mlp& mlp, const std::vector<float>& points, std::vector<int> order);

  /// Other points in place of those so far.
  void set_points(const std::vector<float>& points);
  int64_t slots() const { return static_cast<int64_t>(points_.size()) / 3; }
  /// y(X_s, q, mu) in tiles of 16 slots (mpm/particles/particles.h), on all threads; `state` is (q, mu), the inputs
  /// after X. Tile j of `values` is tile tiles[j] of the points.
  void evaluate(const std::vector<double>& state, const std::vector<int32_t>& tiles, T* values) const;
  /// All of them.
  void evaluate(const std::vector<double>& state, T* values) const;
  /// The same of some tiles, and the derivatives along `directions` of the inputs (X, q, mu) [directions, inputs]:
  /// slopes[k] in tiles as the values.
  void evaluate(const std::vector<double>& state, const Mlp::Rows& directions, const std::vector<int32_t>& tiles,
                T* values, const std::vector<T*>& slopes) const;
  const std::vector<int32_t>& all_tiles() const { return all_tiles_; }
  int64_t bytes() const;

 private:
  /// What q and mu add to the first layer, with its bias.
  Buffer<float> first_bias(const std::vector<double>& state) const;
  /// What a direction of the inputs adds to the first layer, one after the other, [directions, padded width].
  Buffer<float> first_slopes(const Mlp::Rows& directions) const;
  /// Some points, slot by slot of `values` and of `slopes`, which may be none.
  void evaluate_f32(const Buffer<float>& first_bias, const Buffer<float>& first_slopes,
                    const std::vector<int64_t>& points, T* values, const std::vector<T*>& slopes) const;
  void evaluate_f64(const std::vector<double>& state, const Mlp::Rows& directions, const std::vector<int64_t>& points,
                    T* values, const std::vector<T*>& slopes) const;
  T* slot_of(T* values, int64_t slot, std::size_t component) const;

  const Mlp& mlp_;
  std::vector<float> points_;
  std::vector<int> order_;
  std::vector<int32_t> all_tiles_;
  std::vector<nn::Linear> linear_;   ///< f32: the layers, without their biases
  std::vector<Buffer<float>> bias_;  ///< f32: these, padded
};

extern template class MlpPoints<float>;
extern template class MlpPoints<double>;

}  // namespace graupel::rom
