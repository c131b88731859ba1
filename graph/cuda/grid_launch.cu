#include "graph/cuda/grid_launch.h"

#include "graph/cuda/block_cluster.h"

namespace graupel::graph {

namespace {

using namespace cluster;
using namespace grid;

constexpr int64_t most_particles = 16384, most_words = 16384;

/// sums[i] = value(0) + .. + value(i - 1), i <= n; the cluster is synchronized before it returns.
template <typename Value>
__device__ void running_sums(const groups::cluster_group& group, ScanMemory& memory, int64_t n, const Value& value,
                             int32_t* sums) {
  const int64_t each = n / all_threads + 1, first = thread_of(group) * each;
  const int64_t last = first + each < n ? first + each : n;
  int32_t count = 0;
  for (int64_t i = first; i < last; ++i) count += value(i);
  int32_t before = sum_before(group, memory, count);
  for (int64_t i = first; i < last; ++i) {
    sums[i] = before;
    before += value(i);
  }
  if (first <= n && n < first + each) sums[n] = before;
  group.sync();
}

__global__ void __launch_bounds__(block_threads) build_kernel(GridProgram p) {
  __shared__ ScanMemory memory;
  const groups::cluster_group group = groups::this_cluster();
  const auto for_all = [&](int64_t n, const auto& body) {
    for (int64_t i = thread_of(group); i < n; i += all_threads) body(i);
    group.sync();
  };
  const int64_t bits = p.link.bits, pairs = corners * p.particles;
  for_all(p.cleared_size, [&](int64_t i) { p.cleared[i] = 0; });
  for_all(p.particles, p.locate);
  running_sums(
      group, memory, p.words, [&](int64_t w) { return ones(__ldcg(p.locate.k.words + w)); }, p.rank);
  for_all(bits + pairs, Both<LinkCell, FindPairs>{bits, p.link, p.find});
  running_sums(
      group, memory, __ldcg(p.link.level_begin + 1), [&](int64_t c) { return __ldcg(p.find.count + c); }, p.pair_begin);
  for_all(pairs, p.list);
  for_all(pairs, p.order);
}

}  // namespace

bool builds_grid_at_once(int64_t particles, int64_t words) {
  static const bool can = can_launch(build_kernel);
  return can && particles <= most_particles && words <= most_words;
}

void build_grid(const GridProgram& program, void* stream) { launch(build_kernel, program, stream); }

}  // namespace graupel::graph
