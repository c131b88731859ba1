// Compiled for the units whatever the rest is compiled for: nothing but plain functions here.
#include "nn/matrix_extension_mlp.h"

#ifdef __AMX_BF16__
// GCC 12 takes the undefined operands inside its own intrinsics for values that were forgotten (its bug 105593).
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <immintrin.h>

#include <type_traits>

#include "nn/bf16_gemm.h"
#include "nn/matrix_extension_tiles.h"
#endif

namespace graupel::nn {

#ifdef __AMX_BF16__
namespace {

constexpr int block = 2 * side;  ///< rows and outputs that are made at once
constexpr float slope = 0.01f;   ///< leaky_slope of nn/activation.h
constexpr float epsilon = 1e-5f;

/// What one block of rows needs. Arrays that are not needed at the same time share their place, so that all stays in
/// the first-level cache.
struct Scratch {
  union alignas(64) {
    uint16_t input[block * 2 * most_chain_width];
    float output[block * most_chain_width];
  };
  union alignas(64) {
    uint16_t hidden[block * most_chain_width];
    uint16_t latent[block * most_chain_width];
  };
  alignas(64) float sums[2][block * block];
};

/// Calls body with the number of columns, as a constant where that is 128: loops over them are unrolled then.
template <typename Body>
inline void with_columns(int columns, const Body& body) {
  if (columns == 128)
    body(std::integral_constant<int, 128>());
  else
    body(columns);
}

/// Rows [0, rows) of x as bf16; those beyond, up to the next whole tile, are 0.
void round_block(const float* x, int64_t x_stride, int rows, int all_columns, uint16_t* out, int out_stride) {
  with_columns(all_columns, [=](auto columns) {
    for (int r = 0; r < rows; ++r)
      for (int i = 0; i < columns; i += inputs) {
        const float* const from = x + r * x_stride + i;
        const __m512bh both = _mm512_cvtne2ps_pbh(_mm512_load_ps(from + 16), _mm512_load_ps(from));
        _mm512_store_si512(out + r * out_stride + i, reinterpret_cast<const __m512i&>(both));
      }
  });
  for (int r = rows; r < (rows > side ? block : side); ++r)
    for (int i = 0; i < all_columns; i += inputs) _mm512_store_si512(out + r * out_stride + i, _mm512_setzero_si512());
}

/// hidden[:, o..] = leaky_relu(sums).
void activate_block(const float* sums, int rows, uint16_t* hidden, int stride) {
  const __m512 small = _mm512_set1_ps(slope);
#pragma GCC unroll 4
  for (int r = 0; r < rows; ++r) {
    const __m512 a = _mm512_load_ps(sums + r * block), b = _mm512_load_ps(sums + r * block + side);
    const __m512bh both =
        _mm512_cvtne2ps_pbh(_mm512_max_ps(b, _mm512_mul_ps(b, small)), _mm512_max_ps(a, _mm512_mul_ps(a, small)));
    _mm512_store_si512(hidden + r * stride, reinterpret_cast<const __m512i&>(both));
  }
}

/// 32 columns of a row, packed.
inline void pack_panel(const float* x, uint32_t* packed) {
  alignas(64) static constexpr uint16_t turns[2 * side] = {0,  16, 1,  17, 2,  18, 3,  19, 4,  20, 5,
                                                           21, 6,  22, 7,  23, 8,  24, 9,  25, 10, 26,
                                                           11, 27, 12, 28, 13, 29, 14, 30, 15, 31};
  const __m512bh both = _mm512_cvtne2ps_pbh(_mm512_load_ps(x + side), _mm512_load_ps(x));
  _mm512_store_si512(packed,
                     _mm512_permutexvar_epi16(_mm512_load_si512(turns), reinterpret_cast<const __m512i&>(both)));
}

/// 1 / sqrt(mean of the squares of y + epsilon).
template <typename Columns>
inline float scale_of(const float* y, Columns width, int out) {
  __m512 even = _mm512_setzero_ps(), odd = _mm512_setzero_ps();
  for (int c = 0; c < width; c += block) {
    const __m512 a = _mm512_load_ps(y + c), b = _mm512_load_ps(y + c + side);
    even = _mm512_fmadd_ps(a, a, even);
    odd = _mm512_fmadd_ps(b, b, odd);
  }
  const float mean = _mm512_reduce_add_ps(_mm512_add_ps(even, odd)) / static_cast<float>(out);
  return 1.0f / _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(mean + epsilon)));
}

/// latent = [latent +] norm(y) gamma + beta, also as bf16, row after row.
template <bool add>
void finish_rows_of(const MatrixExtensionMlp& chain, const float* y, int rows, float* latent, uint16_t* rounded) {
  with_columns(chain.second.width, [&](auto width) {
    for (int r = 0; r < rows; ++r, y += width, latent += width, rounded += width) {
      const __m512 scale = _mm512_set1_ps(scale_of(y, width, chain.out));
      for (int c = 0; c < width; c += block) {
        __m512 f[2];
        for (int half = 0; half < 2; ++half) {
          const int at = c + half * side;
          const __m512 v = _mm512_mul_ps(_mm512_load_ps(y + at), scale);
          f[half] = _mm512_fmadd_ps(v, _mm512_load_ps(chain.gamma + at), _mm512_load_ps(chain.beta + at));
          if constexpr (add) f[half] = _mm512_add_ps(f[half], _mm512_load_ps(latent + at));
          _mm512_store_ps(latent + at, f[half]);
        }
        const __m512bh both = _mm512_cvtne2ps_pbh(f[1], f[0]);
        _mm512_store_si512(rounded + c, reinterpret_cast<const __m512i&>(both));
      }
    }
  });
}

/// 32 rows, or the last ones.
struct Block {
  int64_t first = 0;
  int rows = 0;
  bool two() const { return rows > side; }
  int tile_rows() const { return two() ? block : side; }
};

/// Matrix units and the vector registers work side by side: what a product leaves is taken up while the next one is
/// made.
template <typename Units>
class ChainPass {
 public:
  ChainPass(const MatrixExtensionMlp& chain, const ChainRows& rows) : chain_(chain), at_(rows) {}

  void run() {
    for (int64_t first = 0; first < at_.rows; first += block) {
      const int64_t left = at_.rows - first;
      const Block here = {first, static_cast<int>(left < block ? left : block)};
      first_layer(here);
      second_layer(here);
      finish_rows(here);
      if (chain_.next.tiles && at_.packed_next)
        next_packed(here);
      else if (chain_.next.tiles)
        next_floats(here);
    }
  }

 private:
  /// Leaves the block's hidden rows.
  void first_layer(const Block& here) {
    const int width = chain_.second.width, in = chain_.second.in;
    const float* const input = at_.input + here.first * at_.input_stride;
    if (!chain_.first.tiles) return round_block(input, at_.input_stride, here.rows, in, scratch_.hidden, in);
    const int all = chain_.first.in, own = at_.with_latent ? all - width : all;
    round_block(input, at_.input_stride, here.rows, own, scratch_.input, all);
    if (at_.with_latent)
      round_block(at_.latent + here.first * width, width, here.rows, width, scratch_.input + own, all);
    const auto activate = [&](int o) {
      activate_block(scratch_.sums[o / block % 2], here.tile_rows(), scratch_.hidden + o, in);
    };
    for (int o = 0; o < in; o += block) {
      units_.multiply_block(chain_.first.tiles, chain_.first.bias, scratch_.input, all, all, o, here.two());
      if (o > 0) activate(o - block);
      units_.store_block(scratch_.sums[o / block % 2], block, here.two());
    }
    activate(in - block);
  }

  void second_layer(const Block& here) {
    const int width = chain_.second.width;
    for (int o = 0; o < width; o += block) {
      units_.multiply_block(chain_.second.tiles, chain_.second.bias, scratch_.hidden, chain_.second.in,
                            chain_.second.in, o, here.two());
      units_.store_block(scratch_.output + o, width, here.two());
    }
  }

  void finish_rows(const Block& here) {
    float* const latent = at_.latent + here.first * chain_.second.width;
    if (at_.add)
      finish_rows_of<true>(chain_, scratch_.output, here.rows, latent, scratch_.latent);
    else
      finish_rows_of<false>(chain_, scratch_.output, here.rows, latent, scratch_.latent);
  }

  void next_floats(const Block& here) {
    const MatrixExtensionLayer& layer = chain_.next;
    float* const y = at_.next + here.first * layer.width;
    for (int o = 0; o < layer.width; o += block) {
      units_.multiply_block(layer.tiles, layer.bias, scratch_.latent, layer.in, layer.in, o, here.two());
      if (here.rows == block) {
        units_.store_block(y + o, layer.width, true);
        continue;
      }
      float* const spare = scratch_.sums[0];
      units_.store_block(spare, block, here.two());
      for (int r = 0; r < here.rows; ++r)
        for (int half = 0; half < 2; ++half)
          _mm512_store_ps(y + r * layer.width + o + half * side, _mm512_load_ps(spare + r * block + half * side));
    }
  }

  void next_packed(const Block& here) {
    const MatrixExtensionLayer& layer = chain_.next;
    const int64_t words = layer.width / 2;
    uint32_t* const y = at_.packed_next + here.first * words;
    const auto pack = [&](int o) {
      const float* const sums = scratch_.sums[o / block % 2];
      for (int r = 0; r < here.rows; ++r) pack_panel(sums + r * block, y + r * words + o / 2);
    };
    for (int o = 0; o < layer.width; o += block) {
      units_.multiply_block(layer.tiles, layer.bias, scratch_.latent, layer.in, layer.in, o, here.two());
      if (o > 0) pack(o - block);
      units_.store_block(scratch_.sums[o / block % 2], block, here.two());
    }
    pack(layer.width - block);
  }

  const MatrixExtensionMlp& chain_;
  const ChainRows& at_;
  Units units_;
  Scratch scratch_;
};

}  // namespace

void apply_chain_on_units(const MatrixExtensionMlp& chain, const ChainRows& rows) {
  if (rows.rows == 0) return;
  if (bf16_units_in_use() == Bf16Extension::matrices)
    ChainPass<AmxTiles>(chain, rows).run();
  else
    ChainPass<Avx512Bf16Tiles>(chain, rows).run();
}
void pack_rows(const float* x, int64_t rows, int width, uint32_t* packed) {
  for (int64_t i = 0; i < rows * width; i += block) pack_panel(x + i, packed + i / 2);
}
#else
void apply_chain_on_units(const MatrixExtensionMlp&, const ChainRows&) {}
void pack_rows(const float*, int64_t, int, uint32_t*) {}
#endif

}  // namespace graupel::nn
