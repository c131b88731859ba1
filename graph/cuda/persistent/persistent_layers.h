// Networks over gathered and summed rows in one cooperative launch. A block of eight warps takes a tile of rows through
//   s[r] = scale * sum over links k of w a(U[link k] + V[r] + T[k])        (or other rows, see Gather)
//   y[r] = LayerNorm(W2 a(W1 [s[r], x[r]] + b1 + table) + b2),  f[r] = add[r] + y[r]
//   out[j][r] = W[j] f[r] + bias[j]                                        (what the next network gathers)
// A grid-wide barrier separates dependent networks. A warp has 16 of the 128 columns. With few rows its part of the
// weights is prefetched into registers while the network before still runs; with many it is read anew for each tile,
// from the L1 cache, and two blocks share a multiprocessor. a = LeakyReLU 0.01, layer norm with eps 1e-5, products in
// bf16 with f32 sums, no atomics on floats. Compute capability 8.0 or later; all pointers are to the GPU's memory.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "graph/cuda/aggregation/pair_aggregation.h"
#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

/// What the first operand of a network is.
enum class Gather : int32_t {
  links,     ///< the sum over six neighbours: link [rows, 6], -1 for none
  children,  ///< over eight children: link [rows, 8], -1 for none
  corners,   ///< over eight cells with weights: link and weight [rows, 8]
  pairs,     ///< over the pairs begin[r] to begin[r + 1] - 1, whose parts are added up in `rows32` (pair_aggregation.h)
  rows,      ///< row link[r] of `rows32`
  features,  ///< `width` f32 features of row r, in three parts (persistent_weights.h)
};

/// Vectors of a network, rows of 128 f32 numbers: biases of both layers, norm, biases of the epilogue. With a decoder
/// the epilogue's second place and the two after it are its second layer.
enum PersistentVector { bias1, bias2, norm_scale, norm_shift, out_bias0, out_bias1, vectors_of_network = 8 };

/// Positions of particles in cells, for what is linear in it: offset_d = frac((x_d - origin_d) / spacing - 1/2).
struct CellOffset {
  const float* position;  ///< [rows, 3]; null: none
  double origin[3], inverse_spacing;
  const float* weight;  ///< [2, 3, 128]: out[j] += sum over d of offset_d weight[j][d]
};

/// One network. Numbers of rows are read on the GPU; links, tables and weights are not written by other networks of the
/// launch, everything else may be.
struct alignas(16) PersistentLayer {
  const int32_t* range;  ///< rows range[0] to range[1] - 1 of the arrays of links; they are rows 0, 1, .. of all others
  int32_t most_rows;     ///< with more rows than that nothing is done

  Gather gather;
  const uint16_t* source;  ///< U, bf16
  const uint16_t* own;     ///< V, bf16; null: 0
  const float* table;      ///< T, f32
  const float* rows32;     ///< Gather::rows, Gather::features and Gather::pairs
  const int32_t *link, *begin;
  PairParts parts;  ///< Gather::pairs
  const float* weight;
  float scale;
  int32_t width;

  const float* second;        ///< x, f32; null: none
  int32_t operands;           ///< of the first layer: 1 or 2
  const float* addend;        ///< table, f32, by addend_row; null: none
  const int32_t* addend_row;  ///< with the links' rows

  const uint16_t* tiles;  ///< packed one after the other: W1 (one a operand), W2, the epilogue's
  const float* vectors;   ///< [vectors_of_network, 128]

  const float* add32;  ///< null: 0
  float* sum32;        ///< f; null: not kept
  int32_t epilogues;   ///< 0 to 2
  uint16_t* out[2];    ///< bf16
  CellOffset offset;
  /// With a decoder, out[0] is not written but d[r] = D2 a(W[0] f[r] + bias[0]) + decoder_bias, [rows, 3].
  float* decoded;
  float decoder_bias[3];
};

/// Networks, one after the other, and those of a launch: first to end - 1.
struct PersistentProgram {
  const PersistentLayer* network;
  uint32_t* done;                            ///< [networks], zero before the launch
  const int32_t* overflow;                   ///< where it is not 0 nothing is done; null: none
  int32_t* fault;                            ///< set to whether nothing was done; null: not wanted
  int32_t networks = 0, first = 0, end = 0;  ///< set by run_networks
};
inline constexpr int most_networks = 272;
inline constexpr int most_persistent_features = 64;

/// `most_rows`: of each network. Neighbours with few rows, and those with many, share a launch. `room_beside` is called
/// once, before the first launch that leaves multiprocessors idle, or after all.
void run_networks(PersistentProgram program, const std::vector<int64_t>& most_rows, void* stream,
                  const std::function<void()>& room_beside = {});

}  // namespace graupel::graph
