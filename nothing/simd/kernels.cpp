// The loops over rows for one instruction set (compiled once for each, with GRAUPEL_ISA its name): products, sums of
// activations and what is done column by column.
#include "nn/simd/lanes.h"

namespace graupel::nn {
namespace {

constexpr float leaky_slope = 0.01f;  ///< of nn/activation.h, which has functions that a linker could take

// Products. The kernel holds `rows` x some columns of y in registers and runs over k, so that each weight that is
// loaded serves all rows and each x serves these columns. Measured on one Zen 4 core (AVX-512), [96 x 128] x [128 x
// 128]: 116 GFLOP/s, the core's peak; Eigen 3.4 82, OpenBLAS 0.3.21 95. On one Zen 3 core (AVX2): 91 of 94; 2 rows x 32
// columns 60.

/// What the registers hold: of AVX-512 8 x 2 vectors, of AVX2, which has half as many, 6 x 2. SSE2 repeats a number in
/// a vector by an instruction of its own, so that each serves the whole panel.
constexpr int most_rows = lanes == 16 ? 8 : lanes == 8 ? 6 : 1, tile_vectors = lanes == 4 ? vectors_of_panel : 2;
static_assert(vectors_of_panel % tile_vectors == 0);

template <int R>
GRAUPEL_ROWS void multiply_tile(const float* x, int64_t x_stride, int in, const float* weight, const float* bias,
                                float* y, int64_t y_stride) {
  Lanes sum[R][tile_vectors];
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < tile_vectors; ++c) sum[r][c] = lanes_at(bias + c * lanes);
  for (int k = 0; k < in; ++k) {
    Lanes w[tile_vectors];
    for (int c = 0; c < tile_vectors; ++c) w[c] = lanes_at(weight + k * panel + c * lanes);
    for (int r = 0; r < R; ++r) {
      const float value = x[r * x_stride + k];
      for (int c = 0; c < tile_vectors; ++c) sum[r][c] += value * w[c];
    }
  }
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < tile_vectors; ++c) lanes_at(y + r * y_stride + c * lanes) = sum[r][c];
}

/// All columns of `rows` rows, at most R.
template <int R>
GRAUPEL_ROWS void multiply_rows(int64_t rows, const float* x, int64_t x_stride, int in, const float* weight,
                                const float* bias, float* y, int64_t y_stride) {
  if (rows == R) {
    for (int c = 0; c < panel; c += tile_vectors * lanes)
      multiply_tile<R>(x, x_stride, in, weight + c, bias + c, y + c, y_stride);
  } else if constexpr (R > 1) {
    multiply_rows<R - 1>(rows, x, x_stride, in, weight, bias, y, y_stride);
  }
}

/// In tiles of even heights: in a tile of few rows sums wait for each other.
void multiply(const float* x, int64_t x_stride, int64_t rows, int in, const float* weight, const float* bias, float* y,
              int64_t y_stride) {
  int64_t r = 0;
  for (int64_t tiles = (rows + most_rows - 1) / most_rows; tiles > 0; --tiles) {
    const int64_t count = (rows - r + tiles - 1) / tiles;
    multiply_rows<most_rows>(count, x + r * x_stride, x_stride, in, weight, bias, y + r * y_stride, y_stride);
    r += count;
  }
}

// Sums of activations over gathered rows, in registers; additions are made in the order of the rows, column by column.

enum class Form { onto_sum, over_base };

/// Columns [column, column + vectors * lanes).
template <int vectors, Form form, typename Word, typename Base>
GRAUPEL_ROWS void add_columns(int column, int n, const ActivatedRow<Word>* rows, const Base* base, float* sum) {
  Lanes start[vectors], total[vectors];
  if constexpr (form == Form::onto_sum) {
    load_columns(sum, column, total);
  } else {
    load_columns(base, column, start);
#pragma GCC unroll 8
    for (int v = 0; v < vectors; ++v) total[v] = Lanes{};
  }
  for (int i = 0; i < n; ++i) {
    Lanes x[vectors];
    load_columns(rows[i].row, column, x);
#pragma GCC unroll 8
    for (int v = 0; v < vectors; ++v) {
      x[v] += lanes_at(rows[i].table + column + v * lanes);
      if constexpr (form == Form::over_base) x[v] += start[v];
      const Lanes small = leaky_slope * x[v];
      x[v] = x[v] > small ? x[v] : small;
      total[v] += rows[i].weight * x[v];
    }
  }
#pragma GCC unroll 8
  for (int v = 0; v < vectors; ++v) lanes_at(sum + column + v * lanes) = total[v];
}

template <Form form, typename Word, typename Base>
GRAUPEL_ROWS void add_rows(int width, int n, const ActivatedRow<Word>* rows, const Base* base, float* sum) {
  constexpr int many = lanes == 16 ? 8 : vectors_of_panel;  // as many as the registers hold
  int column = 0;
  for (; column + many * lanes <= width; column += many * lanes) add_columns<many, form>(column, n, rows, base, sum);
  for (; column < width; column += panel) add_columns<vectors_of_panel, form>(column, n, rows, base, sum);
}

template <typename Word>
void add_activated(int width, int n, const ActivatedRow<Word>* rows, float* sum) {
  add_rows<Form::onto_sum>(width, n, rows, sum, sum);
}
template <typename Word, typename Base>
void sum_activated(int width, int n, const ActivatedRow<Word>* rows, const Base* base, float* sum) {
  add_rows<Form::over_base>(width, n, rows, base, sum);
}

// Column by column.

template <typename Body>
GRAUPEL_ROWS void each_vector(int width, const Body& body) {
  for (int c = 0; c < width; c += panel)
#pragma GCC unroll 8
    for (int v = 0; v < vectors_of_panel; ++v) body(c + v * lanes);
}

void activate(float* y, const float* a, const float* b, const float* c, int width, float slope) {
  const auto put = [=](int i, const Lanes& x) {
    const Lanes small = slope * x;
    lanes_at(y + i) = x >= 0.0f ? x : small;
  };
  if (c)
    each_vector(width, [=](int i) { put(i, lanes_at(a + i) + lanes_at(b + i) + lanes_at(c + i)); });
  else if (b)
    each_vector(width, [=](int i) { put(i, lanes_at(a + i) + lanes_at(b + i)); });
  else
    each_vector(width, [=](int i) { put(i, lanes_at(a + i)); });
}

void add_scaled(float* y, float s, const float* x, int width) {
  each_vector(width, [=](int i) { lanes_at(y + i) += s * lanes_at(x + i); });
}

void add_three(float* y, const float (&factor)[3], const float* const (&x)[3], int width) {
  const float f0 = factor[0], f1 = factor[1], f2 = factor[2];
  const float *x0 = x[0], *x1 = x[1], *x2 = x[2];
  each_vector(width,
              [=](int i) { lanes_at(y + i) += f0 * lanes_at(x0 + i) + f1 * lanes_at(x1 + i) + f2 * lanes_at(x2 + i); });
}

float sum_of_squares(const float* x, int width) {
  Lanes sum[vectors_of_panel] = {};
  for (int c = 0; c < width; c += panel)
#pragma GCC unroll 8
    for (int v = 0; v < vectors_of_panel; ++v) {
      const Lanes& at = lanes_at(x + c + v * lanes);
      sum[v] += at * at;
    }
  for (int v = 1; v < vectors_of_panel; ++v) sum[0] += sum[v];
  float total = 0;
  for (int i = 0; i < lanes; ++i) total += sum[0][i];
  return total;
}

void normalize(float* y, float s, const float* x, const float* gamma, const float* beta, bool onto, int width) {
  const auto normal = [=](int i) { return s * lanes_at(x + i) * lanes_at(gamma + i) + lanes_at(beta + i); };
  if (onto)
    each_vector(width, [=](int i) { lanes_at(y + i) += normal(i); });
  else
    each_vector(width, [=](int i) { lanes_at(y + i) = normal(i); });
}

void scale_sum(float* y, float s, const float* gamma, float t, const float* beta, const float* base, int width) {
  const auto scaled = [=](int i) { return s * lanes_at(gamma + i) * lanes_at(y + i) + t * lanes_at(beta + i); };
  if (base)
    each_vector(width, [=](int i) { lanes_at(y + i) = lanes_at(base + i) + scaled(i); });
  else
    each_vector(width, [=](int i) { lanes_at(y + i) = scaled(i); });
}

}  // namespace

namespace GRAUPEL_ISA {
extern const RowKernels kernels;
const RowKernels kernels = {
    .multiply = multiply,
    .add_activated = add_activated<float>,
    .add_activated_packed = add_activated<uint32_t>,
    .sum_activated = sum_activated<float, float>,
    .sum_activated_packed = sum_activated<uint32_t, float>,
    .sum_activated_over_packed = sum_activated<uint32_t, uint32_t>,
    .activate = activate,
    .add_scaled = add_scaled,
    .add_three = add_three,
    .sum_of_squares = sum_of_squares,
    .normalize = normalize,
    .scale_sum = scale_sum,
};
}  // namespace GRAUPEL_ISA

}  // namespace graupel::nn
