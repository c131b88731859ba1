#include "graph/corrections/free_flight_launch.h"

#include <algorithm>

#include "core/parallel/parallel_for_in.h"
#include "graph/corrections/free_flight_joins.h"
#include "graph/cuda/launch/block_cluster.h"

namespace graupel::graph::flight {

namespace {

constexpr int threads = 128;
constexpr int64_t most_at_once = 16384;  ///< particles of one scene: beyond it two launches are faster
constexpr int join_threads = 4;          ///< threads a particle: few cells have less than four
constexpr unsigned whole_warp = ~0u;
/// Groups of a warp that it adds up in registers; particles of one scene lie side by side, so there are seldom more.
constexpr int common_groups = 2;

__device__ int64_t item_of_thread(unsigned block) { return static_cast<int64_t>(block) * threads + threadIdx.x; }

/// Adds what the lanes have to their groups' sums; slot < 0: nothing. All lanes of a warp must call it.
template <int N>
__device__ void add_by_warp(GroupMomentum* sums, Terms<N> GroupMomentum::*part, int32_t slot, const Terms<N>& terms) {
  const int lane = static_cast<int>(threadIdx.x % 32);
  for (int round = 0; round < common_groups; ++round) {
    const unsigned left = __ballot_sync(whole_warp, slot >= 0);
    if (left == 0) return;
    const int32_t common = __shfl_sync(whole_warp, slot, __ffs(static_cast<int>(left)) - 1);
    const bool mine = slot == common;
    int64_t of_lane = 0;
#pragma unroll
    for (int k = 0; k < N; ++k) {
      int64_t sum = mine ? terms.value[k] : 0;
#pragma unroll
      for (int lanes = 16; lanes > 0; lanes /= 2) sum += __shfl_xor_sync(whole_warp, sum, lanes);
      if (lane == k) of_lane = sum;
    }
    if (lane < N) add_to((sums[common].*part).value[lane], of_lane);
    if (mine) slot = -1;
  }
  if (slot >= 0) add_terms(sums[slot].*part, terms);
}

struct Warp {
  __device__ int lane() const { return static_cast<int>(threadIdx.x % 32); }
  __device__ unsigned ballot(bool here) const { return __ballot_sync(whole_warp, here); }
  template <typename T>
  __device__ T shuffle(T value, int lane) const {
    return __shfl_sync(whole_warp, value, lane);
  }
};

/// Neighbours first: then most particles' nodes have one root each time.
template <typename Items>
__global__ void __launch_bounds__(threads) join_kernel(const __grid_constant__ Items items) {
  const Groups& groups = items.own();
  const Warp warp;
  const int64_t thread = item_of_thread(blockIdx.x), all_threads = int64_t{gridDim.x} * threads;
  for (int time = 0; time < times; ++time) {
    const int64_t items = int64_t{groups.listed[time]} * lanes_of_node, whole_warps = (items + 31) / 32 * 32;
    for (int64_t item = thread; item < whole_warps; item += all_threads)
      join_neighbors(warp, groups, time, item < items ? item : -1);
  }
  if (thread < (groups.n + 31) / 32 * 32) join_times(warp, groups, thread);
}

/// By the last block that comes here, when no other one looks for roots any more.
__device__ void clear_at_last(const Groups& groups) {
  __shared__ bool is_last;
  __threadfence();
  __syncthreads();
  if (threadIdx.x == 0) is_last = atomicAdd(groups.finished, 1) == static_cast<int32_t>(gridDim.x) - 1;
  __syncthreads();
  if (!is_last) return;
  for (int time = 0; time < times; ++time)
    for (int64_t k = threadIdx.x; k < groups.listed[time]; k += threads) ClearNode{groups}.clear(time, k);
  __syncthreads();
  if (threadIdx.x < times) groups.listed[threadIdx.x] = 0;
  if (threadIdx.x == 0) *groups.finished = 0;
}

template <typename Items>
__global__ void __launch_bounds__(threads) place_kernel(const __grid_constant__ Items items) {
  const Groups& groups = items.own();
  const int64_t i = item_of_thread(blockIdx.x);
  const int32_t slot = i < groups.n ? place_particle(groups, i) : -1;
  PlaceTerms terms{};
  if (slot >= 0) terms = groups.place_terms(i, slot);
  add_by_warp(groups.sums, &GroupMomentum::place, slot, terms);
  clear_at_last(groups);
}

/// All lanes of a warp must call it.
__device__ void add_push(const Groups& groups, int64_t i, const Vec3f* next) {
  int32_t slot = i < groups.n ? groups.group[i] : -1;
  if (!groups.flies(slot)) slot = -1;
  PushTerms terms{};
  if (slot >= 0) terms = groups.push_terms(i, slot, next);
  add_by_warp(groups.sums, &GroupMomentum::push, slot, terms);
}

/// Read past the first cache, where the sums of this launch are not.
template <int N>
__device__ Terms<N> sums_of(const Terms<N>& place) {
  Terms<N> terms;
#pragma unroll
  for (int k = 0; k < N; ++k) terms.value[k] = read(place.value[k]);
  return terms;
}

__device__ void correct_particle(const Groups& groups, int64_t i, Vec3f* next) {
  const int32_t slot = groups.group[i];
  if (!groups.flies(slot)) return;
  const GroupMomentum& sums = groups.sums[slot];
  correct(groups, i, slot, change_of(sums.place, sums_of(sums.push), sums.spans_period != 0), next);
}

template <typename Items>
__global__ void __launch_bounds__(threads) push_kernel(const __grid_constant__ Items items) {
  const Correction& c = items.own();
  add_push(c.groups, item_of_thread(blockIdx.x), c.next);
}

template <typename Items>
__global__ void __launch_bounds__(threads) correct_kernel(const __grid_constant__ Items items) {
  const Correction& c = items.own();
  const int64_t i = item_of_thread(blockIdx.x);
  if (i < c.groups.n) correct_particle(c.groups, i, c.next);
}

/// Both by a cluster of blocks.
__global__ void __launch_bounds__(cluster::block_threads) correct_at_once_kernel(Correction c) {
  const cluster::Group group;
  const int64_t first = cluster::thread_of(group), whole_warps = (c.groups.n + 31) / 32 * 32;
  for (int64_t i = first; i < whole_warps; i += cluster::all_threads) add_push(c.groups, i, c.next);
  group.sync();
  for (int64_t i = first; i < c.groups.n; i += cluster::all_threads) correct_particle(c.groups, i, c.next);
}

unsigned blocks_of(int64_t n) { return static_cast<unsigned>((n + threads - 1) / threads); }

}  // namespace

void start_on_gpu(const Groups& groups, const std::vector<float>& from, float* mass, void* stream) {
  parallel_for_in(stream, Device::cuda, groups.nodes(), ClearAll{groups});
  if (from.empty()) return;
  GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(mass, from.data(), from.size() * sizeof(float), cudaMemcpyHostToDevice,
                                     static_cast<cudaStream_t>(stream)));
}

void find_groups_on_gpu(const std::vector<Groups>& scenes, void* stream) {
  std::vector<Loop<MarkCells>> marks;
  int64_t most = 0;
  for (const Groups& groups : scenes) {
    marks.push_back({groups.n, MarkCells{groups}});
    most = std::max(most, groups.n);
  }
  if (most == 0) return;
  const auto in = static_cast<cudaStream_t>(stream);
  parallel_loops_in(stream, Device::cuda, marks);
  launch_items(scenes, [&](const auto& items, unsigned count) {
    join_kernel<<<dim3(join_threads * blocks_of(most), count), threads, 0, in>>>(items);
  });
  launch_items(scenes, [&](const auto& items, unsigned count) {
    place_kernel<<<dim3(blocks_of(most), count), threads, 0, in>>>(items);
  });
}

void correct_on_gpu(const std::vector<Correction>& scenes, void* stream) {
  int64_t most = 0;
  for (const Correction& scene : scenes) most = std::max(most, scene.groups.n);
  if (most == 0) return;
  const auto in = static_cast<cudaStream_t>(stream);
  static const bool at_once = cluster::can_launch(correct_at_once_kernel);
  if (at_once && scenes.size() == 1 && most <= most_at_once)
    return cluster::launch(correct_at_once_kernel, scenes.front(), stream);
  launch_items(scenes, [&](const auto& items, unsigned count) {
    push_kernel<<<dim3(blocks_of(most), count), threads, 0, in>>>(items);
  });
  launch_items(scenes, [&](const auto& items, unsigned count) {
    correct_kernel<<<dim3(blocks_of(most), count), threads, 0, in>>>(items);
  });
}

}  // namespace graupel::graph::flight
