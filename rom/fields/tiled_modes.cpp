#include "rom/fields/tiled_modes.h"

#ifdef __F16C__
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"

namespace graupel::rom {

using mpm::tile;

namespace {

/// 16 lanes; compilers split them over the registers that there are.
template <typename T>
struct LanesOf {
  using type __attribute__((vector_size(tile * sizeof(T)))) = T;
};
template <typename T>
using Lanes = typename LanesOf<T>::type;

template <typename T>
[[gnu::always_inline]] inline void load(const T* from, Lanes<T>& lanes) {
  __builtin_memcpy(&lanes, from, sizeof lanes);
}
[[gnu::always_inline]] inline void load(const uint16_t* from, Lanes<float>& lanes) {
#if defined(__AVX512F__)
  const __m512 wide = _mm512_cvtph_ps(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
  __builtin_memcpy(&lanes, &wide, sizeof lanes);
#elif defined(__F16C__)
  const __m256 wide[2] = {_mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from))),
                          _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from + 8)))};
  __builtin_memcpy(&lanes, wide, sizeof lanes);
#else
  for (int64_t l = 0; l < tile; ++l) lanes[l] = nn::float_from_f16(from[l]);
#endif
}

/// values = mean + sum_k a_k W_k and, unless null, rates = sum_k a'_k W_k of one tile. All accumulators stay in
/// registers.
template <int C, typename T, typename Stored>
void sum_modes(const T* mean, const Stored* basis, int modes, const T* a, const T* a_rate, T* values, T* rates) {
  Lanes<T> sum[C], rate[C], w;
  for (int c = 0; c < C; ++c) {
    load(mean + c * tile, sum[c]);
    rate[c] = Lanes<T>{};
  }
  if (rates) {
    for (int k = 0; k < modes; ++k, basis += C * tile)
      for (int c = 0; c < C; ++c) {
        load(basis + c * tile, w);
        sum[c] += a[k] * w;
        rate[c] += a_rate[k] * w;
      }
    for (int c = 0; c < C; ++c) __builtin_memcpy(rates + c * tile, &rate[c], sizeof rate[c]);
  } else {
    for (int k = 0; k < modes; ++k, basis += C * tile)
      for (int c = 0; c < C; ++c) {
        load(basis + c * tile, w);
        sum[c] += a[k] * w;
      }
  }
  for (int c = 0; c < C; ++c) __builtin_memcpy(values + c * tile, &sum[c], sizeof sum[c]);
}

}  // namespace

template <typename T>
void TiledModes<T>::assign(const ModeTable& table, const std::vector<int32_t>& points, const std::vector<int>& order) {
  const auto slots = static_cast<int64_t>(points.size());
  components_ = static_cast<int>(order.size());
  GRAUPEL_ASSERT(components_ == 3 || components_ == 6 || components_ == 9);
  modes_ = table.modes;
  tiles_ = mpm::padded_to_tile(slots) / tile;
  const bool half = std::is_same_v<T, float> && table.precision == ModePrecision::half;
  const auto size = static_cast<std::size_t>(tiles_ * components_ * modes_ * tile);
  amplitude_.assign(static_cast<std::size_t>(modes_), 1.0);
  if (half) {
    const std::vector<float> amplitude = table.amplitude();
    amplitude_.assign(amplitude.begin(), amplitude.end());
  }
  mean_.resize_discard(static_cast<std::size_t>(tiles_ * components_ * tile));
  basis_.resize_discard(half ? 0 : size);
  half_.resize_discard(half ? size : 0);
  const auto fill_tile = [&](int64_t t) {
    for (int64_t l = 0; l < tile; ++l) {
      const int64_t slot = t * tile + l;
      const int64_t row = slot < slots ? table.row_of(points[static_cast<std::size_t>(slot)]) : -1;
      for (int c = 0; c < components_; ++c) {
        const int64_t from = row * table.components + order[static_cast<std::size_t>(c)];
        mean_[static_cast<std::size_t>((t * components_ + c) * tile + l)] =
            row < 0 ? T(0) : static_cast<T>(table.mean[static_cast<std::size_t>(from)]);
        for (int k = 0; k < modes_; ++k) {
          const auto to = static_cast<std::size_t>(((t * modes_ + k) * components_ + c) * tile + l);
          const float w = row < 0 ? 0.0f : table.basis[static_cast<std::size_t>(from * modes_ + k)];
          if (half)
            half_[to] = nn::f16_from_float(w / static_cast<float>(amplitude_[static_cast<std::size_t>(k)]));
          else
            basis_[to] = static_cast<T>(w);
        }
      }
    }
  };
  parallel_for_cpu(tiles_, fill_tile, Grain{16});
}

template <typename T>
void TiledModes<T>::set_coefficients(const double* a) {
  a_.resize(amplitude_.size());
  for (std::size_t k = 0; k < a_.size(); ++k) a_[k] = static_cast<T>(a[k] * amplitude_[k]);
}

template <typename T>
void TiledModes<T>::set_rates(const double* a_rate) {
  rate_.resize(amplitude_.size());
  for (std::size_t k = 0; k < rate_.size(); ++k) rate_[k] = static_cast<T>(a_rate[k] * amplitude_[k]);
}

template <typename T>
template <int C>
void TiledModes<T>::evaluate_tile(int64_t t, T* values, T* rates) const {
  const T* mean = mean_.data() + t * C * tile;
  const int64_t first = t * modes_ * C * tile;
  if constexpr (std::is_same_v<T, float>)
    if (half_.size() > 0)
      return sum_modes<C>(mean, half_.data() + first, modes_, a_.data(), rate_.data(), values, rates);
  sum_modes<C>(mean, basis_.data() + first, modes_, a_.data(), rate_.data(), values, rates);
}

template <typename T>
void TiledModes<T>::evaluate(int64_t t, T* values, T* rates) const {
  if (components_ == 3) return evaluate_tile<3>(t, values, rates);
  if (components_ == 6) return evaluate_tile<6>(t, values, rates);
  evaluate_tile<9>(t, values, rates);
}

template class TiledModes<float>;
template class TiledModes<double>;

}  // namespace graupel::rom
