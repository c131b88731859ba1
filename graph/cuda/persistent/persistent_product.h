// A warp's part of a network of persistent_layers.cu: 16 of 128 columns of products with tiles that lie in registers.
#pragma once

#include "graph/cuda/persistent/persistent_gather.h"

namespace graupel::graph::wide {

constexpr int warps = threads / 32, steps = layer_width / 16;
static_assert(warps * 16 == layer_width);

/// Where a lane's part of a tile begins.
__device__ inline const uint4* part_of(const uint16_t* tiles, int tile) {
  return reinterpret_cast<const uint4*>(tiles) + tile * (tile_numbers / 8) + (threadIdx.x / 32) * (steps * 32) +
         threadIdx.x % 32;
}
/// A lane's part of a tile, in its registers.
struct TilePart {
  static constexpr int resident = 1;  ///< blocks a multiprocessor
  uint4 word[steps];
  __device__ uint4 at(int k) const { return word[k]; }
};
__device__ inline void load(TilePart& part, const uint16_t* tiles, int tile) {
  const uint4* const from = part_of(tiles, tile);
#pragma unroll
  for (int k = 0; k < steps; ++k)  // here, and not where they are needed
    asm volatile("ld.global.nc.v4.u32 {%0,%1,%2,%3}, [%4];"
                 : "=r"(part.word[k].x), "=r"(part.word[k].y), "=r"(part.word[k].z), "=r"(part.word[k].w)
                 : "l"(from + 32 * k));
}
/// A lane's part of a tile, read anew each time: by the first cache, which has the tiles of one network.
struct TilePlace {
  static constexpr int resident = 2;
  const uint4* from;
  __device__ uint4 at(int k) const { return __ldg(from + 32 * k); }
};
__device__ inline void load(TilePlace& part, const uint16_t* tiles, int tile) { part.from = part_of(tiles, tile); }

/// The tiles of a network; those that it does not have are not touched.
template <typename Tile>
struct Weights {
  Tile first[2], second, epilogue[2];
  __device__ void load_first(const PersistentLayer& n) {
    load(first[0], n.tiles, 0);
    if (n.operands > 1) load(first[1], n.tiles, 1);
  }
  __device__ void load_second(const PersistentLayer& n) { load(second, n.tiles, n.operands); }
  __device__ void load_outlook(const PersistentLayer& n) {
    if (n.epilogues > 0) load(epilogue[0], n.tiles, n.operands + 1);
    if (n.epilogues > 1) load(epilogue[1], n.tiles, n.operands + 2);
  }
};

/// Sums of 16 rows: value(half, i) is column 16 warp + 4 (lane % 4) + i of row lane / 4 + 8 half.
struct Part {
  float c[2][4];
  __device__ void clear() {
#pragma unroll
    for (int j = 0; j < 2; ++j)
#pragma unroll
      for (int i = 0; i < 4; ++i) c[j][i] = 0;
  }
  __device__ float& value(int half, int i) { return c[i / 2][2 * half + i % 2]; }
  __device__ void add(int half, const float4& v) {
    value(half, 0) += v.x, value(half, 1) += v.y, value(half, 2) += v.z, value(half, 3) += v.w;
  }
  __device__ void add(const float4& v) {
    add(0, v);
    add(1, v);
  }
  __device__ void activate() {
#pragma unroll
    for (int j = 0; j < 2; ++j)
#pragma unroll
      for (int i = 0; i < 4; ++i) c[j][i] = fmaxf(c[j][i], slope * c[j][i]);
  }
  __device__ float4 row(int half) { return {value(half, 0), value(half, 1), value(half, 2), value(half, 3)}; }
};

/// c += rows W^T.
template <typename Weight>
__device__ inline void multiply(Part& c, const uint16_t* rows, const Weight& weight, int lane) {
  const uint32_t at = shared_address(rows + (lane % 16) * row_stride + (lane / 16) * 8);
#pragma unroll
  for (int k = 0; k < steps; ++k) {
    uint32_t a[4];
    const uint4 w = weight.at(k);
    load_matrices(a, at + 32 * k);
    multiply_add(c.c[0], a, w.x, w.y);
    multiply_add(c.c[1], a, w.z, w.w);
  }
}

/// Two products at a time, which do not wait for each other: of two operands, or of one with two tiles.
template <typename Weight>
__device__ inline void multiply(Part& c, Part& d, const uint16_t* rows, const uint16_t* other_rows,
                                const Weight& weight, const Weight& other_weight, int lane) {
  const uint32_t at = shared_address(rows + (lane % 16) * row_stride + (lane / 16) * 8);
  const uint32_t other_at = shared_address(other_rows + (lane % 16) * row_stride + (lane / 16) * 8);
#pragma unroll
  for (int k = 0; k < steps; ++k) {
    uint32_t a[4], b[4];
    const uint4 w = weight.at(k), v = other_weight.at(k);
    load_matrices(a, at + 32 * k);
    load_matrices(b, other_at + 32 * k);
    multiply_add(c.c[0], a, w.x, w.y);
    multiply_add(d.c[0], b, v.x, v.y);
    multiply_add(c.c[1], a, w.z, w.w);
    multiply_add(d.c[1], b, v.z, v.w);
  }
}

/// Where a lane's numbers lie.
struct Place {
  int warp, lane, column, group;  ///< group: the first of its rows
  __device__ Place()
      : warp(static_cast<int>(threadIdx.x) / 32),
        lane(static_cast<int>(threadIdx.x) % 32),
        column(16 * warp + 4 * (lane % 4)),
        group(lane / 4) {}
};

}  // namespace graupel::graph::wide
