// The networks of wide_rows.h: a block keeps its place in the list of networks; a warp has 16 columns of each.
#include "graph/cuda/wide_rows.h"

#include "graph/cuda/wide_gather.h"
#include "graph/cuda/wide_product.h"

namespace graupel::graph {

namespace {

using namespace wide;

/// Networks of which a block knows: the one that it works on and the next two, in a ring.
constexpr int descriptions = 4;

/// What a block keeps in shared memory.
template <int tile_rows>
struct Shared {
  __align__(16) uint16_t operand[2][tile_rows * row_stride];
  __align__(16) uint16_t hidden[tile_rows * row_stride];
  __align__(16) float vectors[2][vectors_of_network][layer_width];
  __align__(16) WideNetwork network[descriptions];  ///< of the network that is worked on and of those after it
  __align__(16) Table table[2];
  StagedLinks<tile_rows> links[2];  ///< of the tile that is worked on, and of the next one
  float2 statistics[warps][tile_rows];
  float decoded[warps][tile_rows][3];
  int32_t rows[most_networks], tiles[most_networks], first_link[most_networks];
  bool narrow[most_networks];  ///< in tiles of narrow_rows, so that more blocks share the work
};

__device__ float4 vector_of(const float (&vectors)[vectors_of_network][layer_width], int which, const Place& at) {
  return *reinterpret_cast<const float4*>(&vectors[which][at.column]);
}

__device__ void store(uint16_t* rows, Part& c, const Place& at) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const float4 v = c.row(half);
    *reinterpret_cast<uint2*>(rows + (at.group + 8 * half) * row_stride + at.column) = {pack(v.x, v.y), pack(v.z, v.w)};
  }
}

/// Means and squares of deviations of a warp's 16 columns, row by row.
template <int tile_rows>
__device__ void leave_statistics(Shared<tile_rows>& s, Part& c, int first, const Place& at) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const float4 v = c.row(half);
    const float mean = row_sum(v.x + v.y + v.z + v.w) * (1.0f / 16);
    const float x = v.x - mean, y = v.y - mean, z = v.z - mean, w = v.w - mean;
    const float squares = row_sum(x * x + y * y + z * z + w * w);
    if (at.lane % 4 == 0) s.statistics[at.warp][first + at.group + 8 * half] = {mean, squares};
  }
}

/// Layer norm from the statistics of all warps (Chan et al. 1983, equation 2.1).
template <int tile_rows>
__device__ void normalize(const Shared<tile_rows>& s, int turn, Part& c, int first, const Place& at) {
  const float4 scale = vector_of(s.vectors[turn % 2], norm_scale, at),
               shift = vector_of(s.vectors[turn % 2], norm_shift, at);
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int row = first + at.group + 8 * half;
    float2 part[warps];
    float mean = 0, squares = 0;
#pragma unroll
    for (int w = 0; w < warps; ++w) {
      part[w] = s.statistics[w][row];
      mean += part[w].x;
    }
    mean *= 1.0f / warps;
#pragma unroll
    for (int w = 0; w < warps; ++w) squares += part[w].y + 16 * (part[w].x - mean) * (part[w].x - mean);
    const float inverse = rsqrtf(squares * (1.0f / layer_width) + 1e-5f);
    c.value(half, 0) = (c.value(half, 0) - mean) * inverse * scale.x + shift.x;
    c.value(half, 1) = (c.value(half, 1) - mean) * inverse * scale.y + shift.y;
    c.value(half, 2) = (c.value(half, 2) - mean) * inverse * scale.z + shift.z;
    c.value(half, 3) = (c.value(half, 3) - mean) * inverse * scale.w + shift.w;
  }
}

/// What a row's position in its cell adds to an outlook.
__device__ void add_offset(Part& c, int half, const CellOffset& offset, int out, int64_t row, const Place& at) {
#pragma unroll
  for (int d = 0; d < 3; ++d) {
    const double u =
        (static_cast<double>(__ldg(offset.position + 3 * row + d)) - offset.origin[d]) * offset.inverse_spacing - 0.5;
    const auto part = static_cast<float>(u - floor(u));
    const float4 w = __ldg(reinterpret_cast<const float4*>(offset.weight + (3 * out + d) * layer_width + at.column));
    c.add(half, {part * w.x, part * w.y, part * w.z, part * w.w});
  }
}

/// The decoder's second layer: a warp's columns' parts of its sums.
template <int tile_rows>
__device__ void leave_decoded(Shared<tile_rows>& s, int turn, Part& c, int first, const Place& at) {
#pragma unroll
  for (int d = 0; d < 3; ++d) {
    const float4 w = vector_of(s.vectors[turn % 2], out_bias1 + d, at);
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const float4 v = c.row(half);
      const float sum = row_sum(v.x * w.x + v.y * w.y + v.z * w.z + v.w * w.w);
      if (at.lane % 4 == 0) s.decoded[at.warp][first + at.group + 8 * half][d] = sum;
    }
  }
}

/// A block's way through the networks.
template <int blocks>
class Walk {
 public:
  static constexpr int tile_rows = 16 * blocks;
  __device__ Walk(Shared<tile_rows>& shared, const WideProgram& program) : s_(shared), program_(program) {}

  __device__ void run() {
    count_rows();
    int network = next_network(-1), next = next_network(network), turn = 0;
    if (network == program_.networks) return;
    describe(network, turn);
    describe(next, turn + 1);
    wait_for_copies();
    fetch_vectors(turn);
    stage(network, turn, static_cast<int>(blockIdx.x));
    weights_.load_first(of(turn));
    weights_.load_second(of(turn));
    weights_.load_outlook(of(turn));
    wait_for_copies();
    for (; network < program_.networks; ++turn) {
      const int after_next = next_network(next);
      describe(after_next, turn + 2);
      if (next < program_.networks) fetch_vectors(turn + 1);
      wait_until_complete(network - 1);
      int finished = 0;
      for (int tile = static_cast<int>(blockIdx.x); tile < tiles(network);) {
        const int after = tile + static_cast<int>(gridDim.x);
        const bool goes_on = after < tiles(network);
        ++finished;
        work(network, turn, tile, goes_on ? network : next, goes_on ? after : static_cast<int>(blockIdx.x), finished);
        tile = after;
      }
      network = next;
      next = after_next;
    }
  }

 private:
  __device__ int rows_of_tile(int network) const { return s_.narrow[network] ? narrow_rows : tile_rows; }
  __device__ int tiles(int network) const { return s_.tiles[network]; }
  /// What is known of the network at this turn of the block.
  __device__ const WideNetwork& of(int turn) const { return s_.network[turn & (descriptions - 1)]; }
  /// The next network in which the block has work; their number where there is none.
  __device__ int next_network(int after) const {
    int network = std::min(after + 1, program_.networks);
    while (network < program_.networks && tiles(network) <= static_cast<int>(blockIdx.x)) ++network;
    return network;
  }

  __device__ void count_rows() {
    bool fault = program_.overflow && *program_.overflow != 0;
    for (int i = static_cast<int>(threadIdx.x); i < program_.networks; i += threads) {
      const WideNetwork& n = program_.network[i];
      const int32_t first = n.range[0], rows = n.range[1] - first;
      s_.first_link[i] = first;
      s_.rows[i] = rows;
      const bool narrow = n.gather == Gather::pairs && rows <= narrow_rows * static_cast<int>(gridDim.x);
      s_.narrow[i] = narrow;
      s_.tiles[i] = narrow ? (rows + narrow_rows - 1) / narrow_rows : (rows + tile_rows - 1) / tile_rows;
      fault = fault || rows < 0 || rows > n.most_rows;
    }
    fault = __syncthreads_or(fault);
    if (fault) {
      for (int i = static_cast<int>(threadIdx.x); i < program_.networks; i += threads) s_.tiles[i] = 0;
      __syncthreads();
    }
    if (program_.fault && blockIdx.x == 0 && threadIdx.x == 0) *program_.fault = fault;
  }

  /// Starts to copy what is to be known of a network.
  __device__ void describe(int network, int turn) {
    constexpr int own_words = sizeof(WideNetwork) / 16;
    static_assert(own_words < threads);
    const int i = static_cast<int>(threadIdx.x);
    if (network < program_.networks && i < own_words)
      copy_async<16>(reinterpret_cast<char*>(&s_.network[turn & (descriptions - 1)]) + 16 * i,
                     reinterpret_cast<const char*>(program_.network + network) + 16 * i);
  }
  /// Starts to copy the vectors and the table of a network that is known.
  __device__ void fetch_vectors(int turn) {
    static_assert(vectors_of_network * layer_width == 4 * threads && most_slots * layer_width == 4 * threads);
    const int i = 4 * static_cast<int>(threadIdx.x);
    copy_async<16>(&s_.vectors[turn % 2][0][0] + i, of(turn).vectors + i);
    if (of(turn).table) copy_async<16>(&s_.table[turn % 2][0][0] + i, of(turn).table + i);
  }
  __device__ static void wait_for_copies() {
    asm volatile("cp.async.wait_all;" ::: "memory");
    __syncthreads();
  }

  /// Where one block does all of a network and of the one after it, nobody else waits for the first.
  __device__ bool stays_here(int network) const {
    return tiles(network) == 1 && network + 1 < program_.networks && tiles(network + 1) == 1;
  }
  __device__ void wait_until_complete(int network) {
    if (network >= 0 && threadIdx.x == 0 && !stays_here(network)) {
      const auto wanted = static_cast<uint32_t>(tiles(network));
      uint32_t done = 0;
      do {
        asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(done) : "l"(program_.done + network) : "memory");
      } while (done < wanted);
    }
    __syncthreads();
  }
  /// After all threads have written what others read.
  __device__ void announce(int network, int finished) {
    if (threadIdx.x == 0 && !stays_here(network)) {
      asm volatile("red.release.gpu.global.add.u32 [%0], %1;"
                   :
                   : "l"(program_.done + network), "r"(finished)
                   : "memory");
    }
  }

  __device__ void stage(int network, int turn, int tile) {
    stage_links(s_.links[staged_], of(turn), s_.first_link[network], int64_t{tile} * rows_of_tile(network),
                s_.rows[network]);
  }

  /// One tile. What is to be known of the next one is asked for; where it is of the next network, the weights make
  /// place for those of that network as soon as they have been used.
  __device__ void work(int network, int turn, int tile, int next_network, int next_tile, int finished) {
    const bool ends = next_network != network, last = ends && next_network < program_.networks;
    const WideNetwork& n = of(turn);
    const WideNetwork& next = of(turn + 1);
    const int64_t first_link = s_.first_link[network], first = int64_t{tile} * rows_of_tile(network);
    const int64_t rows = std::min<int64_t>(s_.rows[network], first + rows_of_tile(network));
    const Place at;
    float* const scratch = reinterpret_cast<float*>(s_.hidden);
    if (s_.narrow[network])
      gather_narrow(n, s_.table[turn % 2], first_link, first, rows, s_.operand[0], s_.operand[1], scratch);
    else
      gather(n, s_.links[staged_], s_.table[turn % 2], first_link, first, rows, s_.operand[0], s_.operand[1], scratch);
    float4 before[blocks][2];
#pragma unroll
    for (int b = 0; b < blocks; ++b)
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const int64_t row = first + 16 * b + at.group + 8 * half;
        before[b][half] = {0, 0, 0, 0};
        if (n.add32 && row < rows)
          before[b][half] = __ldcg(reinterpret_cast<const float4*>(n.add32 + row * layer_width + at.column));
      }
    staged_ = 1 - staged_;
    if (next_network < program_.networks) stage(next_network, ends ? turn + 1 : turn, next_tile);
    __syncthreads();

    Part c[blocks];
    first_layer(n, turn, first_link, first, rows, c, at);
    if (last) weights_.load_first(next);
    __syncthreads();

    const float4 bias = vector_of(s_.vectors[turn % 2], bias2, at);
#pragma unroll
    for (int b = 0; b < blocks; ++b) {
      c[b].clear();
      c[b].add(bias);
      multiply(c[b], s_.hidden + 16 * b * row_stride, weights_.second, at.lane);
      leave_statistics(s_, c[b], 16 * b, at);
    }
    if (last) weights_.load_second(next);
    __syncthreads();

#pragma unroll
    for (int b = 0; b < blocks; ++b) {
      normalize(s_, turn, c[b], 16 * b, at);
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        c[b].add(half, before[b][half]);
        const int64_t row = first + 16 * b + at.group + 8 * half;
        if (n.sum32 && row < rows) *reinterpret_cast<float4*>(n.sum32 + row * layer_width + at.column) = c[b].row(half);
      }
      if (n.outlooks > 0) store(s_.operand[0] + 16 * b * row_stride, c[b], at);
    }
    __syncthreads();
    if (n.outlooks > 0) look_ahead(n, turn, first, rows, at);
    if (n.decoded) decode(n, first, rows);
    if (ends) {
      __syncthreads();
      announce(network, finished);
    }
    if (last) weights_.load_outlook(next);
    wait_for_copies();
  }

  __device__ void first_layer(const WideNetwork& n, int turn, int64_t first_link, int64_t first, int64_t rows,
                              Part (&c)[blocks], const Place& at) {
    const float4 bias = vector_of(s_.vectors[turn % 2], bias1, at);
#pragma unroll
    for (int b = 0; b < blocks; ++b) {
      Part other;
      other.clear();
      c[b].clear();
      c[b].add(bias);
      if (n.addend) {
#pragma unroll
        for (int half = 0; half < 2; ++half) {
          const int64_t row = first + 16 * b + at.group + 8 * half;
          if (row >= rows) continue;
          const int64_t which = __ldg(n.addend_row + first_link + row);
          c[b].add(half, __ldg(reinterpret_cast<const float4*>(n.addend + which * layer_width + at.column)));
        }
      }
      const uint16_t* const rows0 = s_.operand[0] + 16 * b * row_stride;
      if (n.operands > 1)
        multiply(c[b], other, rows0, s_.operand[1] + 16 * b * row_stride, weights_.first[0], weights_.first[1],
                 at.lane);
      else
        multiply(c[b], rows0, weights_.first[0], at.lane);
#pragma unroll
      for (int half = 0; half < 2; ++half) c[b].add(half, other.row(half));
      c[b].activate();
      store(s_.hidden + 16 * b * row_stride, c[b], at);
    }
  }

  __device__ void look_ahead(const WideNetwork& n, int turn, int64_t first, int64_t rows, const Place& at) {
#pragma unroll
    for (int b = 0; b < blocks; ++b) {
      const uint16_t* const from = s_.operand[0] + 16 * b * row_stride;
      Part c[2];
#pragma unroll
      for (int j = 0; j < 2; ++j) {
        c[j].clear();
        c[j].add(vector_of(s_.vectors[turn % 2], out_bias0 + j, at));
      }
      if (n.outlooks > 1)
        multiply(c[0], c[1], from, from, weights_.outlook[0], weights_.outlook[1], at.lane);
      else
        multiply(c[0], from, weights_.outlook[0], at.lane);
      if (n.decoded) {
        c[0].activate();
        leave_decoded(s_, turn, c[0], 16 * b, at);
        continue;
      }
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const int64_t row = first + 16 * b + at.group + 8 * half;
        if (row >= rows) continue;
#pragma unroll
        for (int j = 0; j < 2; ++j) {
          if (j >= n.outlooks) continue;
          if (n.offset.position) add_offset(c[j], half, n.offset, j, row, at);
          const float4 v = c[j].row(half);
          *reinterpret_cast<uint2*>(n.out[j] + row * layer_width + at.column) = {pack(v.x, v.y), pack(v.z, v.w)};
        }
      }
    }
  }

  __device__ void decode(const WideNetwork& n, int64_t first, int64_t rows) {
    __syncthreads();
    for (int i = static_cast<int>(threadIdx.x); i < 3 * tile_rows; i += threads) {
      const int row = i / 3, d = i % 3;
      if (first + row >= rows) continue;
      float sum = n.decoder_bias[d];
#pragma unroll
      for (int w = 0; w < warps; ++w) sum += s_.decoded[w][row][d];
      n.decoded[3 * (first + row) + d] = sum;
    }
  }

  Shared<tile_rows>& s_;
  const WideProgram& program_;
  Weights weights_;
  int staged_ = 0;
};

template <int blocks>
__global__ void __launch_bounds__(threads, 1) run_kernel(WideProgram program) {
  Walk<blocks>(*reinterpret_cast<Shared<16 * blocks>*>(shared_numbers), program).run();
}

template <int blocks>
void launch(const WideProgram& program, int64_t most_rows, void* stream) {
  constexpr int tile_rows = 16 * blocks, bytes = sizeof(Shared<tile_rows>);
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(run_kernel<blocks>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes));
  launch_together(run_kernel<blocks>, (most_rows + tile_rows - 1) / tile_rows, threads, bytes, program, stream,
                  program.networks > 1);
}

}  // namespace

void run_networks(const WideProgram& program, int64_t most_rows, void* stream) {
  GRAUPEL_ASSERT(program.networks > 0 && program.networks <= most_networks);
  if (most_rows == 0) return;
  most_rows > int64_t{32} * multiprocessors() ? launch<2>(program, most_rows, stream)
                                              : launch<1>(program, most_rows, stream);
}

}  // namespace graupel::graph
