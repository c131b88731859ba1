// Sums of activations over the items (edges, particle-corner pairs, children) that reach a node, for networks whose
// receivers sum activations (graph/config/hgn_config.h, Aggregation): no products, a row of bf16 numbers read an item.
// The forward pass leaves the sign of every activation, one bit each, which is all that the way back needs. Width 128;
// bf16 numbers are kept as uint16_t; all pointers are to the GPU's memory.
#pragma once

#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

/// Signs of the activations of an item: bit i of byte l belongs to column 8 l + i.
inline constexpr int sign_bytes = layer_width / 8;

/// The items of nodes: item[i], i in [begin[n] - first, begin[n + 1] - first) (item null: i itself), or without `begin`
/// `fixed` items each.
struct NodeItems {
  const int32_t* begin = nullptr;
  int32_t first = 0;
  int32_t fixed = 0;
  const int32_t* item = nullptr;
  bool are_long = false;  ///< some nodes have hundreds
};

/// sum[r] = scale * sum over the items q of receiver r of weight[q] a(sent[sender(q)] + received[r] + table[row(q)]),
/// a = LeakyReLU_0.01.
struct ActivationAggregation {
  int64_t receivers = 0;
  NodeItems items = {};
  RowOf sender = {};                   ///< of an item
  const uint16_t* sent = nullptr;      ///< [*, 128]
  const uint16_t* received = nullptr;  ///< [receivers, 128]; null: 0
  const float* table = nullptr;        ///< [8, 128]
  RowOf table_row = {};                ///< of an item, 0..7
  const float* weight = nullptr;       ///< of an item; null: 1
  float scale = 1;
  uint16_t* sum = nullptr;   ///< [receivers, 128]
  uint8_t* signs = nullptr;  ///< [items, 16]
};
void aggregate_activations(const ActivationAggregation& sums, void* stream);

/// Blocks of partial sums [3, 128] that the gradients below leave at most.
int most_offset_partials();

/// With d[q] = scale * weight[q] a'(q) g[row(q)], the gradient before the activation of item q: out[n] = sum of d over
/// the items of node n; and, where nodes have few items, of the offsets' weights W_o [128, 3], sum of d[q] offset(q).
struct ActivationGradient {
  int64_t nodes = 0;
  NodeItems items = {};
  const uint16_t* g = nullptr;  ///< [*, 128] gradient of the sums
  bool is_receiver = false;     ///< g[n] belongs to all items of node n
  RowOf row = {};               ///< else to an item
  const float* weight = nullptr;
  float scale = 1;
  const uint8_t* signs = nullptr;  ///< null: a' = 1
  uint16_t* out = nullptr;         ///< [nodes, 128], if wanted

  /// Offsets of items: corner: corner_sign (bits of q - offset[n]); octant: 1/2 - bits of octant[n].
  Offsets offsets = Offsets::corner;
  float corner_sign = 1;
  const float* offset = nullptr;    ///< [nodes, 3]
  const int32_t* octant = nullptr;  ///< [nodes]
  float* partial = nullptr;         ///< [most_offset_partials(), 3, 128], to be added
};
/// Returns how many partial sums it writes.
int sum_gradients(const ActivationGradient& gradient, void* stream);

/// The same for edges, from both ends: received[n] over the edges that reach cell n, sent[n] over those that leave it.
/// Offsets are the unit vectors from sender to receiver.
struct EdgeGradient {
  int64_t cells = 0;
  const int32_t *edge_begin = nullptr, *sender = nullptr, *slot = nullptr, *reverse = nullptr;
  const uint16_t* g = nullptr;  ///< [cells, 128]
  const uint8_t* signs = nullptr;
  uint16_t *sent = nullptr, *received = nullptr;  ///< [cells, 128]
  float* partial = nullptr;                       ///< as above
};
int sum_gradients(const EdgeGradient& gradient, void* stream);

}  // namespace graupel::graph
