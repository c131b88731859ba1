// Products of a warp's 16 rows with a 128 x 128 tile on tensor cores (mma.sync m16n8k16, bf16 operands, f32 sums).
#pragma once

#include <cuda_bf16.h>

#include <cstdint>

#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph::tile {

inline constexpr int warp_rows = 16;
/// Numbers between rows in shared memory: 17 16-byte words, so that eight rows lie in different banks.
inline constexpr int row_stride = layer_width + 8;
inline constexpr int column_blocks = layer_width / 8;
inline constexpr int tile_bytes = layer_width * row_stride * 2;
inline constexpr int warp_bytes = warp_rows * row_stride * 2;

/// Sums of 16 rows: c[j][0..1] are columns 8 j + 2 (lane % 4) + {0, 1} of row lane / 4, c[j][2..3] of row lane / 4 + 8.
using Sums = float[column_blocks][4];

__device__ inline uint32_t shared_address(const void* p) { return static_cast<uint32_t>(__cvta_generic_to_shared(p)); }
__device__ inline void load_matrices(uint32_t (&r)[4], uint32_t address) {
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(r[0]), "=r"(r[1]), "=r"(r[2]), "=r"(r[3])
               : "r"(address)
               : "memory");
}
__device__ inline void load_transposed(uint32_t (&r)[4], uint32_t address) {
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(r[0]), "=r"(r[1]), "=r"(r[2]), "=r"(r[3])
               : "r"(address)
               : "memory");
}
__device__ inline void multiply_add(float (&c)[4], const uint32_t (&a)[4], uint32_t b0, uint32_t b1) {
  asm volatile(
      "mma.sync.aligned.m16n8k16.row.col.f32.bf16.bf16.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, {%0,%1,%2,%3};"
      : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
}

__device__ inline void clear(Sums& c) {
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 4; ++i) c[j][i] = 0;
}

/// c += a W^T, W [out, in] in shared memory with row_stride, a 16 rows.
__device__ inline void product(Sums& c, const uint16_t* a, const uint16_t* weight, int lane) {
  const uint32_t a_at = shared_address(a + (lane % 16) * row_stride + (lane / 16) * 8);
  const int m = lane / 8;
  const uint32_t b_at = shared_address(weight + ((m / 2) * 8 + lane % 8) * row_stride + (m % 2) * 8);
#pragma unroll
  for (int k = 0; k < layer_width; k += 16) {
    uint32_t rows[4];
    load_matrices(rows, a_at + 2 * k);
#pragma unroll
    for (int j = 0; j < column_blocks; j += 2) {
      uint32_t b[4];
      load_matrices(b, b_at + 2 * (8 * j * row_stride + k));
      multiply_add(c[j], rows, b[0], b[1]);
      multiply_add(c[j + 1], rows, b[2], b[3]);
    }
  }
}

/// c += a W: the way back through the same tile.
__device__ inline void product_back(Sums& c, const uint16_t* a, const uint16_t* weight, int lane) {
  const uint32_t a_at = shared_address(a + (lane % 16) * row_stride + (lane / 16) * 8);
  const int m = lane / 8;
  const uint32_t b_at = shared_address(weight + ((m % 2) * 8 + lane % 8) * row_stride + (m / 2) * 8);
#pragma unroll
  for (int k = 0; k < layer_width; k += 16) {
    uint32_t rows[4];
    load_matrices(rows, a_at + 2 * k);
#pragma unroll
    for (int j = 0; j < column_blocks; j += 2) {
      uint32_t b[4];
      load_transposed(b, b_at + 2 * (k * row_stride + 8 * j));
      multiply_add(c[j], rows, b[0], b[1]);
      multiply_add(c[j + 1], rows, b[2], b[3]);
    }
  }
}

/// Starts to copy a tile to shared memory; all threads of the block.
__device__ inline void load_tile(uint16_t* to, const uint16_t* from) {
  constexpr int words = layer_width / 8;  // of 16 bytes in a row
  for (int i = static_cast<int>(threadIdx.x); i < layer_width * words; i += static_cast<int>(blockDim.x))
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16;"
                 :
                 : "r"(shared_address(to + (i / words) * row_stride + (i % words) * 8)), "l"(from + 8 * i)
                 : "memory");
}
/// The tiles that were asked for are there; all threads of the block.
__device__ inline void wait_for_tiles() {
  asm volatile("cp.async.wait_all;" ::: "memory");
  __syncthreads();
}

__device__ inline float from_bf16(uint16_t bits) { return __uint_as_float(static_cast<uint32_t>(bits) << 16); }
__device__ inline uint32_t pack(float low, float high) {
  const __nv_bfloat162 both = __floats2bfloat162_rn(low, high);
  uint32_t word;
  memcpy(&word, &both, sizeof(word));
  return word;
}
__device__ inline float2 unpack(uint32_t word) {
  return {__uint_as_float(word << 16), __uint_as_float(word & 0xffff0000u)};
}

/// Writes a warp's sums as bf16 rows into its part of shared memory.
__device__ inline void store_rows(uint16_t* to, const Sums& c, int lane) {
  uint32_t* const low = reinterpret_cast<uint32_t*>(to + (lane / 4) * row_stride) + lane % 4;
  uint32_t* const high = low + 8 * row_stride / 2;
#pragma unroll
  for (int j = 0; j < column_blocks; ++j) {
    low[4 * j] = pack(c[j][0], c[j][1]);
    high[4 * j] = pack(c[j][2], c[j][3]);
  }
}

/// Copies a warp's rows from shared to global memory, [rows, 128], as far as there are rows.
__device__ inline void copy_out(uint16_t* to, const uint16_t* from, int64_t first, int64_t rows, int lane) {
#pragma unroll
  for (int i = 0; i < warp_rows / 2; ++i) {
    const int r = 2 * i + lane / 16;
    if (first + r < rows)
      *reinterpret_cast<uint4*>(to + (first + r) * layer_width + (lane % 16) * 8) =
          *reinterpret_cast<const uint4*>(from + r * row_stride + (lane % 16) * 8);
  }
}

/// Adds eight bf16 numbers, times `weight`.
__device__ inline void add_numbers(float (&sum)[8], const uint4& word, float weight = 1) {
  const uint32_t parts[4] = {word.x, word.y, word.z, word.w};
#pragma unroll
  for (int i = 0; i < 4; ++i) {
    const float2 pair = unpack(parts[i]);
    sum[2 * i] += weight * pair.x;
    sum[2 * i + 1] += weight * pair.y;
  }
}

inline constexpr int rows_under_way = 6;  ///< as many as a cell has neighbours

/// Gathers a warp's rows of an operand into shared memory; rows beyond the last are 0.
__device__ inline void gather_rows(uint16_t* to, const RowOperand& x, int64_t first, int64_t rows, int lane) {
  if (x.begin == nullptr) {
#pragma unroll
    for (int i = 0; i < warp_rows / 2; ++i) {
      const int r = 2 * i + lane / 16;
      uint4 word{0, 0, 0, 0};
      if (first + r < rows) {
        const int64_t from = x.index ? x.index[first + r] : first + r;
        word = *(reinterpret_cast<const uint4*>(x.rows + from * layer_width) + lane % 16);
      }
      *reinterpret_cast<uint4*>(to + r * row_stride + (lane % 16) * 8) = word;
    }
    return;
  }
  // Two rows at a time, 16 lanes and eight columns a lane each; loads of several rows are under way together.
  const int64_t place = first + lane % warp_rows;
  const int32_t begins = place < rows ? x.begin[place] - x.first : 0,
                ends = place < rows ? x.begin[place + 1] - x.first : 0;
#pragma unroll 2
  for (int i = 0; i < warp_rows / 2; ++i) {
    const int r = 2 * i + lane / 16;
    const int32_t begin = __shfl_sync(0xffffffffu, begins, r), end = __shfl_sync(0xffffffffu, ends, r);
    float sum[8] = {};
    for (int32_t at = begin; at < end; at += rows_under_way) {
      uint4 word[rows_under_way];
#pragma unroll
      for (int k = 0; k < rows_under_way; ++k) {
        word[k] = {0, 0, 0, 0};
        if (at + k >= end) continue;
        word[k] = *(reinterpret_cast<const uint4*>(x.rows + int64_t{at + k} * layer_width) + lane % 16);
      }
#pragma unroll
      for (int k = 0; k < rows_under_way; ++k) add_numbers(sum, word[k]);
    }
    *reinterpret_cast<uint4*>(to + r * row_stride + (lane % 16) * 8) = {pack(sum[0], sum[1]), pack(sum[2], sum[3]),
                                                                        pack(sum[4], sum[5]), pack(sum[6], sum[7])};
  }
}

__device__ inline int64_t row_of(const RowOf& row, int64_t r) {
  return row.index ? row.index[r] : (r >> row.shift) & static_cast<int64_t>(row.mask);
}

/// c += the table's rows of this warp's rows.
__device__ inline void add_table(Sums& c, const float* table, const RowOf& row, int64_t first, int64_t rows, int lane) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= rows) continue;
    const float2* const from = reinterpret_cast<const float2*>(table + row_of(row, r) * layer_width) + lane % 4;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 v = from[4 * j];
      c[j][2 * half] += v.x;
      c[j][2 * half + 1] += v.y;
    }
  }
}

/// Sum over the four lanes that share a row.
__device__ inline float row_sum(float value) {
  value += __shfl_xor_sync(0xffffffffu, value, 1);
  return value + __shfl_xor_sync(0xffffffffu, value, 2);
}

/// c becomes (c - mean) / deviation of its rows; returns 1 / deviation of both rows.
__device__ inline void normalize(Sums& c, float (&inverse)[2]) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    float sum = 0;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) sum += c[j][2 * half] + c[j][2 * half + 1];
    const float mean = row_sum(sum) * (1.0f / layer_width);
    float squares = 0;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j)
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        const float d = c[j][2 * half + i] - mean;
        c[j][2 * half + i] = d;
        squares += d * d;
      }
    inverse[half] = rsqrtf(row_sum(squares) * (1.0f / layer_width) + 1e-5f);
#pragma unroll
    for (int j = 0; j < column_blocks; ++j)
#pragma unroll
      for (int i = 0; i < 2; ++i) c[j][2 * half + i] *= inverse[half];
  }
}

/// Adds `values` of the lanes with equal lane % 4 and leaves four of the sums with each lane: those from
/// 16 [lane bit 4] + 8 [bit 3] + 4 [bit 2] on.
__device__ inline void fold(float (&values)[2 * column_blocks], float (&sums)[4], int lane) {
#pragma unroll
  for (int width = column_blocks; width >= 4; width /= 2) {
    const bool upper = (lane & width) != 0;
#pragma unroll
    for (int i = 0; i < width; ++i) {
      const float send = upper ? values[i] : values[i + width], keep = upper ? values[i + width] : values[i];
      values[i] = keep + __shfl_xor_sync(0xffffffffu, send, width);
    }
  }
#pragma unroll
  for (int i = 0; i < 4; ++i) sums[i] += values[i];
}

/// Column of number i of a lane's folded sums, where values[2 j + k] are of the lane's columns of block j.
__device__ inline int folded_column(int i, int lane) {
  const int from = (lane & 16 ? 16 : 0) + (lane & 8 ? 8 : 0) + (lane & 4 ? 4 : 0) + i;
  return 8 * (from / 2) + 2 * (lane % 4) + i % 2;
}

/// Numbers of a vector [128] at this lane's columns of block j.
__device__ inline float2 columns_of(const float* vector, int j, int lane) {
  return *(reinterpret_cast<const float2*>(vector) + 4 * j + lane % 4);
}

__device__ inline void add_bias(Sums& c, const float* bias, int lane) {
#pragma unroll
  for (int j = 0; j < column_blocks; ++j) {
    const float2 b = columns_of(bias, j, lane);
    c[j][0] += b.x, c[j][1] += b.y, c[j][2] += b.x, c[j][3] += b.y;
  }
}

}  // namespace graupel::graph::tile
