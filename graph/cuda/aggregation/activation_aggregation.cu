// Sums of activations and the way back: 16 lanes a node with eight columns each, the rows of several items under way
// together.
#include "graph/cuda/aggregation/activation_aggregation.h"
#include "graph/cuda/aggregation/node_lanes.h"

namespace graupel::graph {

namespace {

using namespace tile;
using namespace lanes;

constexpr int table_rows = 8;
constexpr int long_ways = 4;  ///< groups of a node with many items
constexpr int many_neighbors = 6, many_items = 8;
/// Blocks of the gradients' kernels on a multiprocessor: those that gather rows need more registers.
constexpr int resident(bool is_receiver) { return is_receiver ? 3 : 2; }

__device__ uint4 load_row(const uint16_t* rows, int64_t row, int lane) {
  return *(reinterpret_cast<const uint4*>(rows + row * layer_width) + lane);
}

struct Range {
  int32_t begin, end;
};
__device__ Range range_of(const NodeItems& items, int64_t node) {
  if (items.begin == nullptr) {
    const auto begin = static_cast<int32_t>(node * items.fixed);
    return {begin, begin + items.fixed};
  }
  return {items.begin[node] - items.first, items.begin[node + 1] - items.first};
}

/// Sums of the groups that share a node, in their order; true for the group that has them then.
template <int ways>
__device__ bool join_ways(float (&sum)[columns], int way) {
  if constexpr (ways > 1) {
    __shared__ float parts[threads * columns];
#pragma unroll
    for (int i = 0; i < columns; ++i) parts[i * threads + threadIdx.x] = sum[i];
    __syncthreads();
    if (way > 0) return false;
#pragma unroll
    for (int other = 1; other < ways; ++other)
#pragma unroll
      for (int i = 0; i < columns; ++i) sum[i] += parts[i * threads + threadIdx.x + group * other];
  }
  return true;
}

/// A lane's table numbers lie in two halves, so that the lanes of a group read different banks.
struct Table {
  float4 half[table_rows][2][group];
};

template <int ways, int under_way>
__global__ void __launch_bounds__(threads) sum_kernel(ActivationAggregation s) {
  __shared__ Table table;
  for (int i = static_cast<int>(threadIdx.x); i < table_rows * 2 * group; i += threads) {
    const int half = i % 2, lane = i / 2 % group, row = i / (2 * group);
    table.half[row][half][lane] = reinterpret_cast<const float4*>(s.table)[i];
  }
  __syncthreads();
  const int lane = static_cast<int>(threadIdx.x) % group, way = static_cast<int>(threadIdx.x) / group % ways;
  const int64_t node = (int64_t{blockIdx.x} * threads + threadIdx.x) / (group * ways);
  const bool there = node < s.receivers;
  float sum[columns] = {};
  if (there) {
    float received[columns] = {};
    if (s.received) add_numbers(received, load_row(s.received, node, lane));
    const Range range = range_of(s.items, node);
    for (int32_t at = range.begin + way * under_way; at < range.end; at += ways * under_way) {
      uint4 word[under_way];
      int32_t q[under_way];
      int row[under_way];
      float weight[under_way];
#pragma unroll
      for (int k = 0; k < under_way; ++k) {
        if (at + k >= range.end) continue;
        q[k] = s.items.item ? s.items.item[at + k] : at + k;
        row[k] = static_cast<int>(row_of(s.table_row, q[k]));
        weight[k] = s.weight ? s.weight[q[k]] : 1.0f;
        word[k] = load_row(s.sent, row_of(s.sender, q[k]), lane);
      }
#pragma unroll
      for (int k = 0; k < under_way; ++k) {
        if (at + k >= range.end) continue;
        const float4 low = table.half[row[k]][0][lane], high = table.half[row[k]][1][lane];
        float x[columns] = {low.x, low.y, low.z, low.w, high.x, high.y, high.z, high.w};
        add_numbers(x, word[k]);
        unsigned signs = 0;
#pragma unroll
        for (int i = 0; i < columns; ++i) {
          x[i] += received[i];
          if (x[i] > 0) signs |= 1u << i;
          sum[i] += weight[k] * fmaxf(x[i], slope * x[i]);
        }
        s.signs[int64_t{q[k]} * sign_bytes + lane] = static_cast<uint8_t>(signs);
      }
    }
  }
  if (!join_ways<ways>(sum, way) || !there) return;
#pragma unroll
  for (int i = 0; i < columns; ++i) sum[i] *= s.scale;
  store_row(s.sum, node, sum, lane);
}

/// Gradient before the activation of an item's columns: factor a' g.
__device__ void item_gradient(float (&d)[columns], const float (&g)[columns], unsigned signs, float factor) {
  const float low = slope * factor;
#pragma unroll
  for (int i = 0; i < columns; ++i) d[i] = g[i] * (signs >> i & 1 ? factor : low);
}
__device__ void item_gradient(float (&d)[columns], const uint4& g, unsigned signs, float factor) {
  float numbers[columns] = {};
  add_numbers(numbers, g);
  item_gradient(d, numbers, signs, factor);
}

/// Sums over a block's nodes for the offsets' weights.
using OffsetSums = float[3][columns];
__device__ void add_offset(OffsetSums& sums, const float (&d)[columns], const float (&offset)[3]) {
#pragma unroll
  for (int axis = 0; axis < 3; ++axis)
#pragma unroll
    for (int i = 0; i < columns; ++i) sums[axis][i] += offset[axis] * d[i];
}

/// What the offsets of all items of a node have in common.
template <Offsets offsets>
__device__ void node_offset(float (&offset)[3], const ActivationGradient& d, int64_t node) {
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    offset[axis] = 0;
    if (offsets == Offsets::octant) offset[axis] = offset_of(Offsets::octant, d.octant[node], axis);
    if (offsets == Offsets::corner) offset[axis] = -d.corner_sign * d.offset[3 * node + axis];
  }
}
/// What item k of a node adds to it.
template <Offsets offsets>
__device__ void add_item_offset(OffsetSums& sums, const float (&x)[columns], const ActivationGradient& d, int k) {
  if (offsets == Offsets::corner)
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      if (!(k >> axis & 1)) continue;
#pragma unroll
      for (int i = 0; i < columns; ++i) sums[axis][i] += d.corner_sign * x[i];
    }
}

template <bool is_receiver, Offsets offsets, int under_way>
__global__ void __launch_bounds__(threads, resident(is_receiver)) gradient_kernel(ActivationGradient d) {
  const int lane = static_cast<int>(threadIdx.x) % group;
  OffsetSums offset_sums = {};
  for (int64_t node = int64_t{blockIdx.x} * groups + threadIdx.x / group; node < d.nodes;
       node += int64_t{gridDim.x} * groups) {
    const Range range = range_of(d.items, node);
    float sum[columns] = {}, base[3], own[columns] = {};
    node_offset<offsets>(base, d, node);
    if (is_receiver) add_numbers(own, load_row(d.g, node, lane));
    for (int32_t at = range.begin; at < range.end; at += under_way) {
      uint4 word[under_way];
      unsigned signs[under_way];
      float weight[under_way];
#pragma unroll
      for (int k = 0; k < under_way; ++k) {
        if (at + k >= range.end) continue;
        const int32_t q = d.items.item ? d.items.item[at + k] : at + k;
        signs[k] = d.signs ? d.signs[int64_t{q} * sign_bytes + lane] : 0xffu;
        weight[k] = d.weight ? d.scale * d.weight[q] : d.scale;
        if (!is_receiver) word[k] = load_row(d.g, row_of(d.row, q), lane);
      }
#pragma unroll
      for (int k = 0; k < under_way; ++k) {
        if (at + k >= range.end) continue;
        float x[columns];
        if (is_receiver)
          item_gradient(x, own, signs[k], weight[k]);
        else
          item_gradient(x, word[k], signs[k], weight[k]);
#pragma unroll
        for (int i = 0; i < columns; ++i) sum[i] += x[i];
        add_item_offset<offsets>(offset_sums, x, d, k);
      }
    }
    add_offset(offset_sums, sum, base);
    if (d.out) store_row(d.out, node, sum, lane);
  }
  write_partial(d.partial, offset_sums);
}

/// Nodes with many items: several groups each.
__global__ void __launch_bounds__(threads) long_gradient_kernel(ActivationGradient d) {
  constexpr int ways = long_ways;
  const int lane = static_cast<int>(threadIdx.x) % group, way = static_cast<int>(threadIdx.x) / group % ways;
  const int64_t node = (int64_t{blockIdx.x} * threads + threadIdx.x) / (group * ways);
  const bool there = node < d.nodes;
  float sum[columns] = {};
  const Range range = there ? range_of(d.items, node) : Range{0, 0};
  for (int32_t at = range.begin + way * many_items; at < range.end; at += ways * many_items) {
    uint4 word[many_items];
    unsigned signs[many_items];
    float weight[many_items];
#pragma unroll
    for (int k = 0; k < many_items; ++k) {
      if (at + k >= range.end) continue;
      const int32_t q = d.items.item ? d.items.item[at + k] : at + k;
      signs[k] = d.signs[int64_t{q} * sign_bytes + lane];
      weight[k] = d.weight ? d.scale * d.weight[q] : d.scale;
      word[k] = load_row(d.g, row_of(d.row, q), lane);
    }
#pragma unroll
    for (int k = 0; k < many_items; ++k) {
      if (at + k >= range.end) continue;
      float x[columns];
      item_gradient(x, word[k], signs[k], weight[k]);
#pragma unroll
      for (int i = 0; i < columns; ++i) sum[i] += x[i];
    }
  }
  if (join_ways<ways>(sum, way) && there) store_row(d.out, node, sum, lane);
}

__global__ void __launch_bounds__(threads, resident(false)) edge_gradient_kernel(EdgeGradient d) {
  const int lane = static_cast<int>(threadIdx.x) % group;
  OffsetSums offset_sums = {};
  for (int64_t cell = int64_t{blockIdx.x} * groups + threadIdx.x / group; cell < d.cells;
       cell += int64_t{gridDim.x} * groups) {
    const int32_t begin = d.edge_begin[cell], end = d.edge_begin[cell + 1];
    float own[columns] = {};
    add_numbers(own, load_row(d.g, cell, lane));
    uint4 word[many_neighbors];
    unsigned arriving[many_neighbors], leaving[many_neighbors];
    int slot[many_neighbors];
#pragma unroll
    for (int k = 0; k < many_neighbors; ++k) {
      const int32_t e = begin + k;
      if (e >= end) continue;
      word[k] = load_row(d.g, d.sender[e], lane);
      arriving[k] = d.signs[int64_t{e} * sign_bytes + lane];
      leaving[k] = d.signs[int64_t{d.reverse[e]} * sign_bytes + lane];
      slot[k] = d.slot[e];
    }
    float sent[columns] = {}, received[columns] = {};
#pragma unroll
    for (int k = 0; k < many_neighbors; ++k) {
      if (begin + k >= end) continue;
      float x[columns];
      item_gradient(x, word[k], leaving[k], 1);
#pragma unroll
      for (int i = 0; i < columns; ++i) sent[i] += x[i];
      item_gradient(x, own, arriving[k], 1);
#pragma unroll
      for (int i = 0; i < columns; ++i) received[i] += x[i];
      float offset[3];
#pragma unroll
      for (int axis = 0; axis < 3; ++axis) offset[axis] = offset_of(Offsets::slot, slot[k], axis);
      add_offset(offset_sums, x, offset);
    }
    store_row(d.sent, cell, sent, lane);
    store_row(d.received, cell, received, lane);
  }
  write_partial(d.partial, offset_sums);
}

int few_blocks(int64_t nodes, bool is_receiver) {
  return std::min(blocks_of_groups(nodes, 1), resident(is_receiver) * multiprocessors());
}

template <int ways, int under_way>
void launch_sums(const ActivationAggregation& sums, void* stream) {
  sum_kernel<ways, under_way>
      <<<blocks_of_groups(sums.receivers, ways), threads, 0, static_cast<cudaStream_t>(stream)>>>(sums);
}

template <Offsets offsets, int under_way>
void launch_gradient(const ActivationGradient& gradient, int blocks, void* stream) {
  const auto in = static_cast<cudaStream_t>(stream);
  if (gradient.is_receiver)
    gradient_kernel<true, offsets, under_way><<<blocks, threads, 0, in>>>(gradient);
  else
    gradient_kernel<false, offsets, under_way><<<blocks, threads, 0, in>>>(gradient);
}

}  // namespace

int most_offset_partials() { return resident(true) * multiprocessors(); }

void aggregate_activations(const ActivationAggregation& sums, void* stream) {
  if (sums.receivers == 0) return;
  if (sums.items.are_long)
    launch_sums<long_ways, many_items>(sums, stream);
  else if (sums.items.fixed == many_items)
    launch_sums<1, many_items>(sums, stream);
  else
    launch_sums<1, many_neighbors>(sums, stream);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

int sum_gradients(const ActivationGradient& gradient, void* stream) {
  if (gradient.nodes == 0) return 0;
  const int blocks = gradient.items.are_long ? 0 : few_blocks(gradient.nodes, gradient.is_receiver);
  GRAUPEL_ASSERT((gradient.partial != nullptr) == (blocks > 0));
  if (gradient.items.are_long) {
    GRAUPEL_ASSERT(!gradient.is_receiver);
    long_gradient_kernel<<<blocks_of_groups(gradient.nodes, long_ways), threads, 0,
                           static_cast<cudaStream_t>(stream)>>>(gradient);
  } else if (gradient.offsets == Offsets::corner) {
    GRAUPEL_ASSERT(gradient.items.fixed == many_items && !gradient.items.item);  // item k of a node is corner k
    launch_gradient<Offsets::corner, many_items>(gradient, blocks, stream);
  } else {
    GRAUPEL_ASSERT(gradient.offsets == Offsets::octant);
    launch_gradient<Offsets::octant, 1>(gradient, blocks, stream);
  }
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
  return blocks;
}

int sum_gradients(const EdgeGradient& gradient, void* stream) {
  if (gradient.cells == 0) return 0;
  const int blocks = few_blocks(gradient.cells, false);
  edge_gradient_kernel<<<blocks, threads, 0, static_cast<cudaStream_t>(stream)>>>(gradient);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
  return blocks;
}

}  // namespace graupel::graph
