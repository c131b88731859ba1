#include "graph/cuda/near_lanes.h"
#include "graph/cuda/near_sums.h"
#include "graph/cuda/node_lanes.h"

namespace graupel::graph {

namespace {

using namespace lanes;

/// Blocks of a multiprocessor.
constexpr int resident = 2;

__global__ void __launch_bounds__(tile::threads, resident) near_sum_kernel(NearSums s) {
  const int lane = static_cast<int>(threadIdx.x) % group;
  const near::LaneWeights weights(s, lane);
  for (int64_t n = int64_t{blockIdx.x} * groups + threadIdx.x / group; n < s.links.particles;
       n += int64_t{gridDim.x} * groups) {
    float sum[columns];
    near::sum_links(s, weights, n, lane, sum);
    store_row(s.sum, n, sum, lane);
  }
}

__global__ void __launch_bounds__(tile::threads, resident) near_gradient_kernel(NearGradient d) {
  const int lane = static_cast<int>(threadIdx.x) % group;
  float weight[near::features][columns] = {};
  for (int64_t n = int64_t{blockIdx.x} * groups + threadIdx.x / group; n < d.links.particles;
       n += int64_t{gridDim.x} * groups) {
    float sent[columns], received[columns];
    near::sum_link_gradients(d, n, lane, sent, received, weight);
    store_row(d.sent, n, sent, lane);
    store_row(d.received, n, received, lane);
  }
  write_partial(d.partial, weight);
}

int blocks_for(int64_t particles) { return std::min(blocks_of_groups(particles, 1), resident * multiprocessors()); }

}  // namespace

void sum_near(const NearSums& sums, void* stream) {
  if (sums.links.particles == 0) return;
  near_sum_kernel<<<blocks_for(sums.links.particles), tile::threads, 0, static_cast<cudaStream_t>(stream)>>>(sums);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

int sum_gradients(const NearGradient& gradient, void* stream) {
  if (gradient.links.particles == 0) return 0;
  const int blocks = blocks_for(gradient.links.particles);
  near_gradient_kernel<<<blocks, tile::threads, 0, static_cast<cudaStream_t>(stream)>>>(gradient);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
  return blocks;
}

}  // namespace graupel::graph
