// P2G of reduced-order models' integration points on a GPU, run here by fibers, under the laws of all schedules.
#include "rom/cuda/device_decode.h"
#include "tests/fiber_block.h"
#include "tests/mpm/kernels/particle_to_grid_laws.h"

namespace graupel::rom {
namespace {

/// A warp a point, from its decoded fields.
struct IntegrationPointsOnGpu {
  using T = float;
  static constexpr int D = 3;
  static constexpr Spline spline = Spline::quadratic;
  static bool available() { return true; }

  static mpm::NodeSums sums(const mpm::SolverView<float>& view, float dt) {
    const mpm::ParticleView<float>& p = view.particles;
    const auto blocks = static_cast<std::size_t>(view.grid.directory_size());
    constexpr int32_t round = 5;
    std::vector<long long> mark(blocks);
    for (std::size_t b = 0; b < blocks; ++b)
      mark[b] = (static_cast<long long>(round) << 32) | static_cast<long long>(b);
    std::vector<float> nodes(blocks * device::block_nodes * mpm::channels), mass, volume;
    for (int64_t i = 0; i < p.count; ++i) {
      volume.push_back(p.volume.get(i));
      mass.push_back(view.materials[p.material.get(i)].density * p.volume.get(i));
    }
    device::InstanceState state{};
    state.round = round;
    device::InstanceView instance{};
    instance.scene = view;
    instance.point_mass = mass.data();
    instance.point_volume = volume.data();
    instance.block_mark = mark.data();
    instance.sums = nodes.data();
    instance.state = &state;
    device::RunView run{};
    run.dt = dt;
    const device::MarkedGrid grid(instance);
    FiberBlock warp(warp_width);
    for (int32_t i = 0; i < p.count; ++i) {
      alignas(16) float decoded[24] = {};
      const Mat<float, 3> C = mpm::load_matrix<float, 3>(p.affine_velocity, i);
      for (int d = 0; d < 3; ++d) {
        decoded[d] = p.position.vec(i)[d];
        decoded[3 + d] = p.velocity.vec(i)[d];
      }
      for (int k = 0; k < 6; ++k) decoded[6 + k] = p.stress.vec(i)[k];
      for (int k = 0; k < 9; ++k) decoded[12 + k] = C(k / 3, k % 3);
      warp.run(0, [&](const FiberThread& lane) { device::scatter_point(lane, run, instance, grid, i, decoded); });
    }
    mpm::NodeSums sums;
    for (std::size_t entry = 0; entry < blocks * device::block_nodes; ++entry) {
      const float* node = nodes.data() + entry * mpm::channels;
      if (node[3] == 0) continue;
      const Vec<int, 3> block = view.grid.block_of(static_cast<int32_t>(entry / device::block_nodes)),
                        c = mpm::node_in_block<3>(static_cast<int>(entry % device::block_nodes)),
                        at = mpm::block_width * block + c;
      for (std::size_t k = 0; k < 4; ++k) sums[{at[0], at[1], at[2]}][k] = static_cast<double>(node[k]);
    }
    return sums;
  }
};

}  // namespace
}  // namespace graupel::rom

namespace graupel::mpm {
INSTANTIATE_TYPED_TEST_SUITE_P(ReducedModel, ParticleToGrid, rom::IntegrationPointsOnGpu);
}  // namespace graupel::mpm
