#include "rom/networks/mlp_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <type_traits>

#include "core/system/error.h"
#include "mpm/particles/particles.h"
#include "nn/linear.h"

namespace graupel::rom {

namespace {

using mpm::tile;

constexpr int64_t block = 4;  ///< tiles whose activations are in memory at a time

/// exp(x) for x <= 0, one unit in the last place: 2^n (1 + r p(r)), |r| <= ln 2 / 2, with the polynomial of Cephes'
/// expf. Branchless, so that the compiler makes vector instructions of it.
inline float exp_of_negative(float x) {
  constexpr float log2_e = 1.44269504f, ln2_high = 0.693359375f, ln2_low = -2.12194440e-4f;
  x = std::max(x, -87.0f);
  const float n = std::floor(std::max(-126.0f, x * log2_e + 0.5f));  // of no number too; r and the result stay one then
  const float r = x - n * ln2_high - n * ln2_low;
  float p = 1.9875691500e-4f;
  p = p * r + 1.3981999507e-3f;
  p = p * r + 8.3334519073e-3f;
  p = p * r + 4.1665795894e-2f;
  p = p * r + 1.6666665459e-1f;
  p = p * r + 5.0000001201e-1f;
  return (p * r * r + r + 1.0f) * std::bit_cast<float>((static_cast<int32_t>(n) + 127) << 23);
}

/// y = elu(y + b).
void activate_row(float* y, const float* bias, int width) {
#pragma omp simd
  for (int c = 0; c < width; ++c) {
    const float x = y[c] + bias[c];
    y[c] = x > 0.0f ? x : exp_of_negative(std::min(x, 0.0f)) - 1.0f;
  }
}

/// t = elu' t, from y = elu: elu' is 1 or y + 1.
void scale_slopes(const float* y, float* slopes, int width) {
#pragma omp simd
  for (int c = 0; c < width; ++c) slopes[c] *= y[c] > 0.0f ? 1.0f : y[c] + 1.0f;
}

Buffer<float> padded(const std::vector<float>& values) {
  Buffer<float> buffer(Device::cpu, static_cast<std::size_t>(nn::padded_width(static_cast<int>(values.size()))));
  buffer.fill_zero();
  std::copy(values.begin(), values.end(), buffer.begin());
  return buffer;
}

/// Memory of a thread for the activations of a block.
float* scratch(std::size_t which, std::size_t count) {
  thread_local Buffer<float> buffers[2];
  if (buffers[which].size() < count) buffers[which] = Buffer<float>(Device::cpu, count);
  return buffers[which].data();
}

}  // namespace

template <typename T>
MlpPoints<T>::MlpPoints(const Mlp& mlp, const std::vector<float>& points, std::vector<int> order)
    : mlp_(mlp), order_(std::move(order)) {
  set_points(points);
  if constexpr (std::is_same_v<T, float>) {
    for (int l = 0; l < Mlp::layer_count; ++l) {
      const MlpLayer& layer = mlp.layers()[static_cast<std::size_t>(l)];
      linear_.emplace_back(layer.out, l == 0 ? 3 : layer.in, layer.weight.data(), layer.in);
      bias_.push_back(padded(layer.bias));
    }
  }
}

template <typename T>
void MlpPoints<T>::set_points(const std::vector<float>& points) {
  points_ = points;
  all_tiles_.resize(static_cast<std::size_t>(mpm::padded_to_tile(slots()) / tile));
  std::iota(all_tiles_.begin(), all_tiles_.end(), 0);
}

template <typename T>
Buffer<float> MlpPoints<T>::first_bias(const std::vector<double>& state) const {
  const MlpLayer& layer = mlp_.layers().front();
  std::vector<float> bias(static_cast<std::size_t>(layer.out));
  for (int o = 0; o < layer.out; ++o) {
    double sum = static_cast<double>(layer.bias[static_cast<std::size_t>(o)]);
    for (std::size_t i = 0; i < state.size(); ++i)
      sum += static_cast<double>(layer.weight[static_cast<std::size_t>(o * layer.in) + 3 + i]) *
             (state[i] - mlp_.input().shift[3 + i]) * mlp_.input().scale[3 + i];
    bias[static_cast<std::size_t>(o)] = static_cast<float>(sum);
  }
  return padded(bias);
}

template <typename T>
Buffer<float> MlpPoints<T>::first_slopes(const Mlp::Rows& directions) const {
  const MlpLayer& layer = mlp_.layers().front();
  const auto stride = static_cast<std::size_t>(nn::padded_width(layer.out));
  Buffer<float> slopes(Device::cpu, static_cast<std::size_t>(directions.rows()) * stride);
  slopes.fill_zero();
  for (Eigen::Index k = 0; k < directions.rows(); ++k)
    for (int o = 0; o < layer.out; ++o) {
      double sum = 0;
      for (int i = 0; i < layer.in; ++i)
        sum += static_cast<double>(layer.weight[static_cast<std::size_t>(o * layer.in + i)]) * directions(k, i) *
               mlp_.input().scale[static_cast<std::size_t>(i)];
      slopes[static_cast<std::size_t>(k) * stride + static_cast<std::size_t>(o)] = static_cast<float>(sum);
    }
  return slopes;
}

/// Rows of a block: its points' values, then their derivatives along each direction.
template <typename T>
void MlpPoints<T>::evaluate_f32(const Buffer<float>& first, const Buffer<float>& first_slopes,
                                const std::vector<int64_t>& points, T* values, const std::vector<T*>& slopes) const {
  const auto n = static_cast<int64_t>(points.size()), directions = static_cast<int64_t>(slopes.size()),
             rows = n * (1 + directions);
  const int64_t width = nn::padded_width(std::max(mlp_.width(), mlp_.outputs()));
  const auto count = static_cast<std::size_t>(block * tile * (1 + directions) * width);
  float *x = scratch(0, count), *y = scratch(1, count);
  for (int64_t r = 0; r < n; ++r)
    for (std::size_t d = 0; d < 3; ++d)
      x[r * 3 + static_cast<int64_t>(d)] = static_cast<float>(
          (static_cast<double>(points_[static_cast<std::size_t>(3 * points[static_cast<std::size_t>(r)]) + d]) -
           mlp_.input().shift[d]) *
          mlp_.input().scale[d]);
  int64_t stride = 3;
  for (int l = 0; l < Mlp::layer_count; ++l) {
    const nn::Linear& linear = linear_[static_cast<std::size_t>(l)];
    linear.apply(x, stride, l == 0 ? n : rows, y, width);
    if (l == 0)  // the derivatives of its inputs are the same at all points
      for (int64_t k = 0; k < directions; ++k)
        for (int64_t r = 0; r < n; ++r)
          std::copy_n(first_slopes.data() + k * linear.width(), linear.width(), y + ((1 + k) * n + r) * width);
    stride = width;
    std::swap(x, y);
    if (l == Mlp::hidden_layers) break;
    const float* bias = l == 0 ? first.data() : bias_[static_cast<std::size_t>(l)].data();
    for (int64_t r = 0; r < n; ++r) {
      activate_row(x + r * stride, bias, linear.width());
      for (int64_t k = 0; k < directions; ++k)
        scale_slopes(x + r * stride, x + ((1 + k) * n + r) * stride, linear.width());
    }
  }
  for (std::size_t c = 0; c < order_.size(); ++c) {
    const auto from = static_cast<std::size_t>(order_[c]);
    const auto scale = static_cast<T>(mlp_.output().scale[from]), shift = static_cast<T>(mlp_.output().shift[from]);
    const float bias = bias_.back()[from];
    for (int64_t r = 0; r < n; ++r)
      *slot_of(values, r, c) = static_cast<T>(x[r * stride + static_cast<int64_t>(from)] + bias) * scale + shift;
    for (int64_t k = 0; k < directions; ++k)
      for (int64_t r = 0; r < n; ++r)
        *slot_of(slopes[static_cast<std::size_t>(k)], r, c) =
            static_cast<T>(x[((1 + k) * n + r) * stride + static_cast<int64_t>(from)]) * scale;
  }
}

template <typename T>
void MlpPoints<T>::evaluate_f64(const std::vector<double>& state, const Mlp::Rows& directions,
                                const std::vector<int64_t>& points, T* values, const std::vector<T*>& slopes) const {
  const auto rows = static_cast<Eigen::Index>(points.size());
  Mlp::Rows z(rows, mlp_.inputs()), y, jacobian;
  for (Eigen::Index r = 0; r < rows; ++r) {
    for (Eigen::Index d = 0; d < 3; ++d)
      z(r, d) = static_cast<double>(points_[static_cast<std::size_t>(3 * points[static_cast<std::size_t>(r)] + d)]);
    for (std::size_t i = 0; i < state.size(); ++i) z(r, static_cast<Eigen::Index>(3 + i)) = state[i];
  }
  if (slopes.empty())
    mlp_.evaluate(z, y);
  else
    mlp_.evaluate(z, y, jacobian);
  for (std::size_t c = 0; c < order_.size(); ++c)
    for (Eigen::Index r = 0; r < rows; ++r) {
      *slot_of(values, r, c) = static_cast<T>(y(r, order_[c]));
      for (std::size_t k = 0; k < slopes.size(); ++k)
        *slot_of(slopes[k], r, c) = static_cast<T>(
            jacobian.row(r * mlp_.outputs() + order_[c]).dot(directions.row(static_cast<Eigen::Index>(k))));
    }
}

template <typename T>
T* MlpPoints<T>::slot_of(T* values, int64_t slot, std::size_t component) const {
  const auto width = static_cast<int64_t>(order_.size());
  return values + (slot / tile * width + static_cast<int64_t>(component)) * tile + slot % tile;
}

template <typename T>
void MlpPoints<T>::evaluate(const std::vector<double>& state, const Mlp::Rows& directions,
                            const std::vector<int32_t>& tiles, T* values, const std::vector<T*>& slopes) const {
  GRAUPEL_ASSERT(static_cast<int>(state.size()) + 3 == mlp_.inputs());
  GRAUPEL_ASSERT(directions.rows() == static_cast<Eigen::Index>(slopes.size()));
  const bool single = std::is_same_v<T, float>;
  const Buffer<float> first = single ? first_bias(state) : Buffer<float>(),
                      first_slope = single ? first_slopes(directions) : Buffer<float>();
  const auto count = static_cast<int64_t>(tiles.size()), width = static_cast<int64_t>(order_.size()) * tile;
  const auto run = [&](int64_t b) {
    T* to = values + b * block * width;
    std::vector<T*> slopes_to;
    slopes_to.reserve(slopes.size());
    for (T* slope : slopes) slopes_to.push_back(slope + b * block * width);
    std::vector<int64_t> points;
    for (int64_t t = b * block; t < std::min((b + 1) * block, count); ++t)
      for (int64_t l = 0; l < tile; ++l) points.push_back(tile * tiles[static_cast<std::size_t>(t)] + l);
    const auto all = static_cast<int64_t>(points.size());
    while (!points.empty() && points.back() >= slots()) points.pop_back();  // the end of the last tile
    if constexpr (std::is_same_v<T, float>)
      evaluate_f32(first, first_slope, points, to, slopes_to);
    else
      evaluate_f64(state, directions, points, to, slopes_to);
    for (auto slot = static_cast<int64_t>(points.size()); slot < all; ++slot)
      for (std::size_t c = 0; c < order_.size(); ++c) {
        *slot_of(to, slot, c) = T(0);
        for (T* slope : slopes_to) *slot_of(slope, slot, c) = T(0);
      }
  };
  parallel_for_cpu((count + block - 1) / block, run, Grain{1});
}

template <typename T>
void MlpPoints<T>::evaluate(const std::vector<double>& state, const std::vector<int32_t>& tiles, T* values) const {
  evaluate(state, Mlp::Rows(0, mlp_.inputs()), tiles, values, {});
}

template <typename T>
void MlpPoints<T>::evaluate(const std::vector<double>& state, T* values) const {
  evaluate(state, all_tiles_, values);
}

template <typename T>
int64_t MlpPoints<T>::bytes() const {
  std::size_t sum = points_.size();
  for (const MlpLayer& layer : mlp_.layers()) sum += layer.weight.size() + layer.bias.size();
  return static_cast<int64_t>(sum * sizeof(float));
}

template class MlpPoints<float>;
template class MlpPoints<double>;

}  // namespace graupel::rom
