// Weights and offsets in the form that the kernels take, and the first layer of the encoder.
#include "graph/cuda/fused_mlp/row_block.h"
#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

namespace {

using namespace tile;

constexpr int tile_parts = 8;  ///< blocks of a tile

__global__ void __launch_bounds__(threads) pack_tiles_kernel(const TileSource* sources, uint16_t* tiles) {
  const TileSource source = sources[blockIdx.x];
  uint32_t* const to = reinterpret_cast<uint32_t*>(tiles + int64_t{blockIdx.x} * tile_numbers);
  for (int i = static_cast<int>(blockIdx.y * threads + threadIdx.x); i < tile_numbers / 2; i += threads * tile_parts) {
    const int row = i / (layer_width / 2), column = 2 * (i % (layer_width / 2));
    const float* const from = source.source + int64_t{row} * source.stride + column;
    to[i] = pack(column < source.columns ? from[0] : 0, column + 1 < source.columns ? from[1] : 0);
  }
}

__global__ void __launch_bounds__(layer_width) make_tables_kernel(const OffsetTable* tables, float* out) {
  const OffsetTable table = tables[blockIdx.x];
  const int t = static_cast<int>(blockIdx.y), column = static_cast<int>(threadIdx.x);
  const bool is_embedding = table.offsets == Offsets::embedding;
  if (is_embedding ? t >= types : t >= 8) return;
  float sum = 0;
  for (int d = 0; d < (is_embedding ? table.width : 3); ++d)
    sum += (is_embedding ? table.embedding[t * table.width + d] : offset_of(table.offsets, t, d)) *
           table.w[int64_t{column} * table.stride + d];
  out[(int64_t{blockIdx.x} * most_table_rows + t) * layer_width + column] =
      table.sign * sum + (table.bias ? table.bias[column] : 0);
}

/// A thread a column, some rows a block: the matrix is read once a block.
constexpr int feature_rows = 32;
__global__ void __launch_bounds__(layer_width) encode_kernel(FeatureLayer layer) {
  __shared__ __align__(16) float features[layer_width * feature_rows];
  const int column = static_cast<int>(threadIdx.x);
  const int64_t first = int64_t{blockIdx.x} * feature_rows;
  const int rows = static_cast<int>(layer.rows - first < feature_rows ? layer.rows - first : feature_rows);
  for (int i = column; i < feature_rows * layer.width; i += layer_width)
    features[i % layer.width * feature_rows + i / layer.width] =
        i < rows * layer.width ? layer.features[first * layer.width + i] : 0;
  __syncthreads();
  float sums[feature_rows] = {};
  const float* const weights = layer.w1 + int64_t{column} * layer.stride;
  for (int k = 0; k < layer.width; ++k) {
    const float w = weights[k];
#pragma unroll
    for (int r = 0; r < feature_rows; r += 4) {
      const float4 x = *reinterpret_cast<const float4*>(features + k * feature_rows + r);
      sums[r] += w * x.x, sums[r + 1] += w * x.y, sums[r + 2] += w * x.z, sums[r + 3] += w * x.w;
    }
  }
#pragma unroll
  for (int r = 0; r < feature_rows; ++r)
    if (r < rows)
      layer.out[(first + r) * layer_width + column] =
          sums[r] + layer.type_table[int64_t{layer.type_row[first + r]} * layer_width + column];
}

__global__ void __launch_bounds__(threads)
    pack_rows_kernel(int64_t rows, int columns, const float* source, uint32_t* packed) {
  const int64_t i = int64_t{blockIdx.x} * threads + threadIdx.x, row = i / (layer_width / 2);
  if (row >= rows) return;
  const int column = 2 * static_cast<int>(i % (layer_width / 2));
  const float* const from = source + row * columns + column;
  packed[i] = pack(column < columns ? from[0] : 0, column + 1 < columns ? from[1] : 0);
}

}  // namespace

void pack_tiles(int count, const TileSource* sources, uint16_t* tiles, void* stream) {
  pack_tiles_kernel<<<dim3(static_cast<unsigned>(count), tile_parts), threads, 0, static_cast<cudaStream_t>(stream)>>>(
      sources, tiles);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

void make_tables(int count, const OffsetTable* tables, float* out, void* stream) {
  make_tables_kernel<<<dim3(static_cast<unsigned>(count), most_table_rows), layer_width, 0,
                       static_cast<cudaStream_t>(stream)>>>(tables, out);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

void encode_features(const FeatureLayer& layer, void* stream) {
  if (layer.rows == 0) return;
  GRAUPEL_ASSERT(layer.width <= layer_width);
  encode_kernel<<<static_cast<unsigned>((layer.rows + feature_rows - 1) / feature_rows), layer_width, 0,
                  static_cast<cudaStream_t>(stream)>>>(layer);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

void pack_rows(int64_t rows, int columns, const float* source, uint16_t* packed, void* stream) {
  if (rows == 0) return;
  GRAUPEL_ASSERT(columns <= layer_width);
  const auto blocks = static_cast<int>((rows * (layer_width / 2) + threads - 1) / threads);
  pack_rows_kernel<<<blocks, threads, 0, static_cast<cudaStream_t>(stream)>>>(rows, columns, source,
                                                                              reinterpret_cast<uint32_t*>(packed));
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

}  // namespace graupel::graph
