// The two-layer networks of the hierarchical graph network over many rows (pairs, edges, cells), each in one kernel:
// rows are gathered, both matrix products run on tensor cores (bf16 operands, f32 sums), the layer norm and what
// follows it in registers. Forward for rollouts and training, backward with recomputation for training. Width 128;
// compute capability 8.0 or later. All pointers are to the GPU's memory; bf16 numbers are kept as uint16_t. Where a
// number of rows comes with a `row_count`, it is the most that there may be: how many there are is read there when the
// kernel runs, so that a recorded launch serves every frame.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/parallel/host_device.h"

namespace graupel::graph {

inline constexpr int layer_width = 128;
/// A layer's matrix [out, in] as a tile: 128 x 128 bf16 numbers without gaps.
inline constexpr int tile_numbers = layer_width * layer_width;

/// Which row of a table belongs to row r: index[r], or (r >> shift) & mask where there is no index.
struct RowOf {
  const int32_t* index = nullptr;
  int shift = 0;
  int32_t mask = -1;
};

/// A bf16 operand of the first layer, [*, 128]: row index[r]; or the sum of the rows begin[r] - first to
/// begin[r + 1] - first - 1, where `begin` is given.
struct RowOperand {
  const uint16_t* rows = nullptr;
  const int32_t* index = nullptr;
  const int32_t* begin = nullptr;
  int32_t first = 0;
  uint16_t* save = nullptr;          ///< [rows, 128] the operand as it was used, if wanted
  const uint16_t* weight = nullptr;  ///< tile
};

/// An f32 addend of the first layer, [*, 128].
struct RowTable {
  const float* table = nullptr;
  RowOf row;
};

/// Four f32 numbers a row, [*, 4], that enter the first layer by a matrix [128, 4].
struct RowFeatures {
  const float* values = nullptr;
  const float* weight = nullptr;
};

/// What the next kernels want of rows x: out[j] = x W[j]^T + bias[j], f32 or bf16 (out16).
struct Projections {
  const uint16_t* weight[2] = {nullptr, nullptr};
  const float* bias[2] = {nullptr, nullptr};
  float* out[2] = {nullptr, nullptr};
  uint16_t* out16[2] = {nullptr, nullptr};
};

/// y[r] = LayerNorm(W2 LeakyReLU(sum of operands W1^T + sum of tables) + b2), r < rows, eps 1e-5.
struct FusedMlp {
  int64_t rows = 0;
  const int32_t* row_count = nullptr;
  RowOperand operand[2];
  RowTable table[3];
  RowFeatures features;          ///< of a network without operands
  float slope = 0.01f;           ///< of the activation below zero
  const uint16_t* w2 = nullptr;  ///< tile
  const float *b2 = nullptr, *gamma = nullptr, *beta = nullptr;

  // Results, where wanted
  uint16_t* out16 = nullptr;        ///< y
  const uint16_t* add16 = nullptr;  ///< sum16 = add16 + y
  uint16_t* sum16 = nullptr;
  const float* add32 = nullptr;  ///< sum32 = add32 + y; null: 0
  float* sum32 = nullptr;
  uint16_t* copy16 = nullptr;  ///< sum32 rounded
  /// Sums of eight rows each, group32[g] = group_add32[g] + sum over r / 8 = g of group_weight[r] y[r]: of a network
  /// without operands, in place of the other sums.
  const float *group_weight = nullptr, *group_add32 = nullptr;
  float* group32 = nullptr;
  Projections epilogue;  ///< of sum32's rows, rounded, where wanted: of a network with two operands
};
void forward(const FusedMlp& network, void* stream);
/// Whether the GPU has the shared memory that networks with an epilogue need.
bool can_project_ahead();

/// Gradient of an operand: result = add + d, f32 or bf16.
struct OperandGradient {
  const float* add32 = nullptr;
  float* d32 = nullptr;
  const uint16_t* add16 = nullptr;
  uint16_t* d16 = nullptr;
};

/// What goes back through a FusedMlp whose results' gradient is g[r] = g32[row(r)] + g16[r], absent parts 0.
struct FusedMlpGradient {
  FusedMlp network;  ///< results are not written
  const float* g32 = nullptr;
  RowOf g_row = {};
  const uint16_t* g16 = nullptr;

  uint16_t* hidden = nullptr;  ///< [rows, 128] activations of the first layer
  uint16_t* d_raw = nullptr;   ///< [rows, 128] gradient before the layer norm
  uint16_t* d_sum = nullptr;   ///< [rows, 128] gradient before the activation
  OperandGradient operand[2] = {};
  float* norm_partial = nullptr;  ///< [most_norm_partials(), 256] gamma's and beta's gradients, to be added
};
int most_norm_partials();
/// Returns how many partial sums of the norm's gradients it writes.
int backward(const FusedMlpGradient& gradient, void* stream);

/// Projections of rows x to which sign[j] V[j] offset is added, V[j] [128, 3] with rows `offset_stride` apart.
struct RowProjection {
  int64_t rows = 0;
  const int32_t* row_count = nullptr;
  const uint16_t* x = nullptr;
  Projections to = {};
  const float* offset = nullptr;  ///< [rows, 3]; null: none
  const float* offset_weight[2] = {nullptr, nullptr};
  int32_t offset_stride[2] = {0, 0};
  float offset_sign[2] = {1, 1};
};
void project(const RowProjection& projection, void* stream);

/// The way back: sum32 = add32 + sum over j of d[j] W[j].
struct ProjectionGradient {
  int64_t rows = 0;
  RowOperand d[2];  ///< rows and weights alone
  const float* add32 = nullptr;
  float* sum32 = nullptr;
};
void project_back(const ProjectionGradient& gradient, void* stream);

/// out[s] = scale * sum of weight[i] source[i] over the rows i of segment s.
struct SegmentRows {
  int64_t segments = 0;
  const int32_t* row_count = nullptr;  ///< of segments
  const int32_t* begin = nullptr;      ///< [segments + 1]
  int32_t first = 0;                   ///< subtracted from `begin`
  const int32_t* item = nullptr;       ///< rows; null: as they stand
  bool are_long = false;               ///< some have hundreds of rows
  const uint16_t* source = nullptr;
  const float* weight = nullptr;  ///< of a row
  float scale = 1;
  float* out32 = nullptr;
  uint16_t* out16 = nullptr;
};
void sum_segments(const SegmentRows& segments, void* stream);

/// A matrix [128, columns], rows `stride` apart, of which a tile is made; columns from `columns` on are 0.
struct TileSource {
  const float* source;
  int32_t stride, columns;
};
/// Tiles of `count` matrices; `sources` lies in the GPU's memory.
void pack_tiles(int count, const TileSource* sources, uint16_t* tiles, void* stream);
/// Offsets that few things have: of corners (their bits), octants (1/2 - bits), neighbour slots (the unit vector from
/// sender to receiver), and embeddings of types.
enum class Offsets : int32_t { corner, octant, slot, embedding };
/// Coordinate d of number t of them.
GRAUPEL_HD inline float offset_of(Offsets offsets, int t, int d) {
  // a sender at -x (slot 0) sees its receiver at +x
  if (offsets == Offsets::slot) return t / 2 != d ? 0.0f : t % 2 == 0 ? 1.0f : -1.0f;
  const float bit = static_cast<float>(t >> d & 1);
  return offsets == Offsets::octant ? 0.5f - bit : bit;
}
inline constexpr int most_table_rows = 16;
/// Rows bias + sign W offset, W with rows `stride` apart; an embedding [types, width] takes the offsets' place.
struct OffsetTable {
  Offsets offsets;
  float sign;
  const float* w;
  int32_t stride;
  const float* bias;
  const float* embedding;
  int32_t width;
};
/// Tables [count, most_table_rows, 128]; `tables` lies in the GPU's memory.
void make_tables(int count, const OffsetTable* tables, float* out, void* stream);

/// First layer of the encoder before its activation, in f32: out[r] = W1 features[r] + type_table[type_row[r]].
struct FeatureLayer {
  int64_t rows = 0;
  const float* features = nullptr;  ///< [rows, width], width at most 128
  int width = 0;
  const float* w1 = nullptr;  ///< [128, width], rows `stride` apart
  int32_t stride = 0;
  const int32_t* type_row = nullptr;
  const float* type_table = nullptr;  ///< with the layer's bias
  float* out = nullptr;
};
void encode_features(const FeatureLayer& layer, void* stream);

/// The decoder: out[r] = W2 LeakyReLU(W1 x[r] + b1) + b2, W2 [3 frames, 128].
struct Decoder {
  int64_t rows = 0;
  int frames = 1;                 ///< predicted at once (FeatureConfig::bundle)
  const float* x = nullptr;       ///< [rows, 128]
  const uint16_t* x16 = nullptr;  ///< the same, rounded, in its place
  const uint16_t* w1 = nullptr;   ///< tile
  const float *b1 = nullptr, *w2 = nullptr, *b2 = nullptr;
  float slope = 0.01f;
  float* out = nullptr;  ///< [rows, 3 frames]
};
void decode(const Decoder& decoder, void* stream);

/// What goes back through a decoder of one frame from the gradient g [rows, 3] of its results.
struct DecoderGradient {
  int64_t rows = 0;
  const uint16_t* x16 = nullptr;  ///< [rows, 128]
  const uint16_t* w1 = nullptr;   ///< tile
  const float *b1 = nullptr, *w2 = nullptr;
  const float* g = nullptr;
  uint16_t* d_sum = nullptr;  ///< [rows, 128] gradient before the activation
  float* d_x = nullptr;       ///< [rows, 128]
  float* partial = nullptr;  ///< [most_norm_partials(), 4, 128] the gradients of W2 and, three numbers, b2, to be added
};
/// Returns how many partial sums it writes.
int decode_backward(const DecoderGradient& gradient, void* stream);

/// Rows [rows, columns] of f32 numbers, columns <= 128, as [rows, 128] bf16 numbers, padded with 0.
void pack_rows(int64_t rows, int columns, const float* source, uint16_t* packed, void* stream);

/// One product of the gradients of weights, out[i, k] = sum over rows of d[r, i] x[r, k], k < columns, rows of `out`
/// `stride` apart; and, where wanted, bias[i] = sum over rows of d[r, i].
struct WeightProduct {
  int64_t rows = 0;
  const uint16_t* d = nullptr;
  const uint16_t* x = nullptr;
  float* out = nullptr;
  int32_t stride = 0, columns = layer_width;
  float* bias = nullptr;
};

/// Sums over partial sums [rows, parts, 128]: number (k, i) to out[i stride + k step], but where there is a `bias` the
/// last k's to bias[i], i < biases.
struct PartialSums {
  int64_t rows = 0;
  const float* partial = nullptr;
  int32_t parts = 0;
  float* out = nullptr;
  int32_t stride = 1, step = 1;
  float* bias = nullptr;
  int32_t biases = layer_width;
};

/// All products of a step in two launches. Sums are made in a fixed order.
class WeightProducts {
 public:
  WeightProducts();
  ~WeightProducts();
  WeightProducts(const WeightProducts&) = delete;
  WeightProducts& operator=(const WeightProducts&) = delete;
  void add(const WeightProduct& product) { products_.push_back(product); }
  void add(const PartialSums& sums) { partials_.push_back(sums); }
  /// Runs what was added, and forgets it.
  void run(void* stream);

 private:
  struct Memory;
  std::vector<WeightProduct> products_;
  std::vector<PartialSums> partials_;
  std::unique_ptr<Memory> memory_;
};

}  // namespace graupel::graph
