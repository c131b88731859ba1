// The networks of persistent_layers.h: a block keeps its place in the list of networks; a warp has 16 columns of each.
#include "graph/cuda/persistent/persistent_layers.h"

#include "graph/cuda/persistent/persistent_tile.h"

namespace graupel::graph {

namespace {

using namespace wide;

/// A block's way through the networks of its launch.
template <typename Tile>
class Walk {
 public:
  __device__ Walk(TileMemory& shared, const PersistentProgram& program) : s_(shared), program_(program) {}

  __device__ void run() {
    count_rows();
    int network = next_network(program_.first - 1), next = next_network(network), pipeline_index = 0;
    if (network == program_.end) return;
    describe(network, pipeline_index);
    describe(next, pipeline_index + 1);
    wait_for_copies();
    fetch_vectors(pipeline_index);
    stage(network, pipeline_index, static_cast<int>(blockIdx.x));
    weights_.load_first(of(pipeline_index));
    weights_.load_second(of(pipeline_index));
    weights_.load_outlook(of(pipeline_index));
    wait_for_copies();
    for (; network < program_.end; ++pipeline_index) {
      const int after_next = next_network(next);
      describe(after_next, pipeline_index + 2);
      if (next < program_.end) fetch_vectors(pipeline_index + 1);
      wait_until_complete(network - 1);
      int finished = 0;
      for (int tile = static_cast<int>(blockIdx.x); tile < tiles(network);) {
        const int after = tile + static_cast<int>(gridDim.x);
        const bool goes_on = after < tiles(network);
        ++finished;
        work(network, pipeline_index, tile, goes_on ? network : next, goes_on ? after : static_cast<int>(blockIdx.x),
             finished);
        tile = after;
      }
      network = next;
      next = after_next;
    }
  }

 private:
  __device__ int tiles(int network) const { return s_.tiles[network]; }
  /// Description of the network at this pipeline index.
  __device__ const PersistentLayer& of(int pipeline_index) const {
    return s_.network[pipeline_index & (descriptions - 1)];
  }
  /// The next network of the launch in which the block has work; its end where there is none.
  __device__ int next_network(int after) const {
    int network = std::min(after + 1, program_.end);
    while (network < program_.end && tiles(network) <= static_cast<int>(blockIdx.x)) ++network;
    return network;
  }

  __device__ void count_rows() {
    bool fault = program_.overflow && *program_.overflow != 0;
    for (int i = static_cast<int>(threadIdx.x); i < program_.networks; i += threads) {
      const PersistentLayer& n = program_.network[i];
      const int32_t first = n.range[0], rows = n.range[1] - first;
      s_.first_link[i] = first;
      s_.rows[i] = rows;
      s_.tiles[i] = (rows + tile_rows - 1) / tile_rows;
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
  __device__ void describe(int network, int pipeline_index) {
    constexpr int own_words = sizeof(PersistentLayer) / 16;
    static_assert(own_words < threads);
    const int i = static_cast<int>(threadIdx.x);
    if (network < program_.end && i < own_words)
      copy_async<16>(reinterpret_cast<char*>(&s_.network[pipeline_index & (descriptions - 1)]) + 16 * i,
                     reinterpret_cast<const char*>(program_.network + network) + 16 * i);
  }
  /// Starts to copy the vectors and the table of a network that is known.
  __device__ void fetch_vectors(int pipeline_index) {
    static_assert(vectors_of_network * layer_width == 4 * threads && most_slots * layer_width == 4 * threads);
    const int i = 4 * static_cast<int>(threadIdx.x);
    copy_async<16>(&s_.vectors[pipeline_index % 2][0][0] + i, of(pipeline_index).vectors + i);
    if (of(pipeline_index).table) copy_async<16>(&s_.table[pipeline_index % 2][0][0] + i, of(pipeline_index).table + i);
  }
  __device__ static void wait_for_copies() {
    asm volatile("cp.async.wait_all;" ::: "memory");
    __syncthreads();
  }

  /// Where one block does all of a network and of the one after it, nobody else waits for the first.
  __device__ bool stays_here(int network) const {
    return tiles(network) == 1 && network + 1 < program_.end && tiles(network + 1) == 1;
  }
  __device__ void wait_until_complete(int network) {
    if (network >= program_.first && threadIdx.x == 0 && !stays_here(network)) {
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
    if (threadIdx.x == 0 && network + 1 < program_.end && !stays_here(network)) {
      asm volatile("red.release.gpu.global.add.u32 [%0], %1;"
                   :
                   : "l"(program_.done + network), "r"(finished)
                   : "memory");
    }
  }

  __device__ void stage(int network, int pipeline_index, int tile) {
    stage_links(s_.links[staged_], of(pipeline_index), s_.first_link[network], int64_t{tile} * tile_rows,
                s_.rows[network]);
  }

  /// One tile. What is to be known of the next one is asked for; where it is of the next network, the weights make
  /// place for those of that network as soon as they have been used.
  __device__ void work(int network, int pipeline_index, int tile, int next_network, int next_tile, int finished) {
    const bool ends = next_network != network, last = ends && next_network < program_.end;
    const PersistentLayer& n = of(pipeline_index);
    const PersistentLayer& next = of(pipeline_index + 1);
    const int64_t first_link = s_.first_link[network], first = int64_t{tile} * tile_rows;
    const int64_t rows = std::min<int64_t>(s_.rows[network], first + tile_rows);
    const Place at;
    float* const scratch = reinterpret_cast<float*>(s_.hidden);
    gather(n, s_.links[staged_], s_.table[pipeline_index % 2], first_link, first, rows, s_.operand[0], s_.operand[1],
           scratch);
    if (n.offset.position)
      for (int i = static_cast<int>(threadIdx.x); i < 3 * tile_rows; i += threads)
        if (first + i / 3 < rows) s_.offset[i / 3][i % 3] = cell_offset(n.offset, first + i / 3, i % 3);
    float4 before[2];
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const int64_t row = first + at.group + 8 * half;
      before[half] = {0, 0, 0, 0};
      if (n.add32 && row < rows)
        before[half] = __ldcg(reinterpret_cast<const float4*>(n.add32 + row * layer_width + at.column));
    }
    staged_ = 1 - staged_;
    if (next_network < program_.end) stage(next_network, ends ? pipeline_index + 1 : pipeline_index, next_tile);
    __syncthreads();

    Part c;
    first_layer(n, pipeline_index, first_link, first, rows, c, at);
    if (last) weights_.load_first(next);
    __syncthreads();

    c.clear();
    c.add(vector_of(s_.vectors[pipeline_index % 2], bias2, at));
    multiply(c, s_.hidden, weights_.second, at.lane);
    leave_statistics(s_, c, at);
    if (last) weights_.load_second(next);
    __syncthreads();

    normalize(s_, pipeline_index, c, at);
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      c.add(half, before[half]);
      const int64_t row = first + at.group + 8 * half;
      if (n.sum32 && row < rows) *reinterpret_cast<float4*>(n.sum32 + row * layer_width + at.column) = c.row(half);
    }
    if (n.epilogues > 0) store(s_.operand[0], c, at);
    __syncthreads();
    if (n.epilogues > 0) look_ahead(n, pipeline_index, first, rows, at);
    if (n.decoded) decode(n, first, rows);
    if (ends) {
      __syncthreads();
      announce(network, finished);
    }
    if (last) weights_.load_outlook(next);
    wait_for_copies();
  }

  __device__ void first_layer(const PersistentLayer& n, int pipeline_index, int64_t first_link, int64_t first,
                              int64_t rows, Part& c, const Place& at) {
    Part other;
    other.clear();
    c.clear();
    c.add(vector_of(s_.vectors[pipeline_index % 2], bias1, at));
    if (n.addend) {
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const int64_t row = first + at.group + 8 * half;
        if (row >= rows) continue;
        const int64_t which = __ldg(n.addend_row + first_link + row);
        c.add(half, __ldg(reinterpret_cast<const float4*>(n.addend + which * layer_width + at.column)));
      }
    }
    if (n.operands > 1)
      multiply(c, other, s_.operand[0], s_.operand[1], weights_.first[0], weights_.first[1], at.lane);
    else
      multiply(c, s_.operand[0], weights_.first[0], at.lane);
#pragma unroll
    for (int half = 0; half < 2; ++half) c.add(half, other.row(half));
    c.activate();
    store(s_.hidden, c, at);
  }

  __device__ void look_ahead(const PersistentLayer& n, int pipeline_index, int64_t first, int64_t rows,
                             const Place& at) {
    const uint16_t* const from = s_.operand[0];
    Part c[2];
#pragma unroll
    for (int j = 0; j < 2; ++j) {
      c[j].clear();
      c[j].add(vector_of(s_.vectors[pipeline_index % 2], out_bias0 + j, at));
    }
    if (n.epilogues > 1)
      multiply(c[0], c[1], from, from, weights_.epilogue[0], weights_.epilogue[1], at.lane);
    else
      multiply(c[0], from, weights_.epilogue[0], at.lane);
    if (n.decoded) {
      c[0].activate();
      leave_decoded(s_, pipeline_index, c[0], at);
      return;
    }
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const int64_t row = first + at.group + 8 * half;
      if (row >= rows) continue;
#pragma unroll
      for (int j = 0; j < 2; ++j) {
        if (j >= n.epilogues) continue;
        if (n.offset.position) add_offset(c[j], half, n.offset, j, s_.offset[row - first], at);
        const float4 v = c[j].row(half);
        *reinterpret_cast<uint2*>(n.out[j] + row * layer_width + at.column) = {pack(v.x, v.y), pack(v.z, v.w)};
      }
    }
  }

  __device__ void decode(const PersistentLayer& n, int64_t first, int64_t rows) {
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

  TileMemory& s_;
  const PersistentProgram& program_;
  Weights<Tile> weights_;
  int staged_ = 0;
};

/// Few rows: tiles in registers, asked for ahead, one block a multiprocessor. Many: the blocks of a multiprocessor
/// work while others wait.
template <typename Tile>
__global__ void __launch_bounds__(threads, Tile::resident) run_kernel(PersistentProgram program) {
  Walk<Tile>(*reinterpret_cast<TileMemory*>(shared_numbers), program).run();
}

/// What the blocks of a multiprocessor do not need of its shared memory is the first cache's.
void leave_to_cache(const void* kernel, int bytes) {
  int device = 0, all = 0, reserved = 0;
  GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&all, cudaDevAttrMaxSharedMemoryPerMultiprocessor, device));
  GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&reserved, cudaDevAttrReservedSharedMemoryPerBlock, device));
  const int percent = std::min(100, (100 * (bytes + TilePlace::resident * reserved) + all - 1) / all);
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributePreferredSharedMemoryCarveout, percent));
}

template <typename Tile>
void launch(const PersistentProgram& program, int64_t most_rows, void* stream) {
  constexpr int bytes = sizeof(TileMemory);
  const auto kernel = run_kernel<Tile>;
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes));
  if (Tile::resident > 1) leave_to_cache(reinterpret_cast<const void*>(kernel), Tile::resident * bytes);
  launch_together(kernel, (most_rows + tile_rows - 1) / tile_rows, threads, bytes, program, stream,
                  program.end - program.first > 1, Tile::resident);
}

/// More rows than one tile a multiprocessor.
bool has_many(int64_t rows) { return rows > int64_t{tile_rows} * multiprocessors(); }

}  // namespace

void run_networks(PersistentProgram program, const std::vector<int64_t>& most_rows, void* stream,
                  const std::function<void()>& room_beside) {
  const auto count = static_cast<int32_t>(most_rows.size());
  GRAUPEL_ASSERT(count > 0 && count <= most_networks);
  program.networks = count;
  bool called = false;
  for (program.first = 0; program.first < count; program.first = program.end) {
    const auto begin = most_rows.begin() + program.first;
    const auto end =
        std::find_if(begin, most_rows.end(), [&](int64_t rows) { return has_many(rows) != has_many(*begin); });
    program.end = static_cast<int32_t>(end - most_rows.begin());
    const int64_t most = *std::max_element(begin, end);
    if (most == 0) continue;
    if (room_beside && !called && !has_many(most)) {
      called = true;
      room_beside();
    }
    has_many(most) ? launch<TilePlace>(program, most, stream) : launch<TilePart>(program, most, stream);
  }
  if (room_beside && !called) room_beside();
}

}  // namespace graupel::graph
