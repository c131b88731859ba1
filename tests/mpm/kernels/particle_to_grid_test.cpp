// The schedules of P2G in mpm/ under their laws (tests/mpm/kernels/particle_to_grid_laws.h): portable by owner blocks
// and by nodes, vectorised on every instruction set, and on GPUs by blocks and for small scenes, which fibers run here.
// The sixth, of reduced-order models, is in tests/rom/particle_to_grid_test.cpp.
#include "mpm/cpu/tuned_phases.h"
#include "tests/mpm/kernels/fiber_backend.h"
#include "tests/mpm/kernels/particle_to_grid_laws.h"

namespace graupel::mpm {
namespace {

template <typename Scalar, int dimensions, Spline S>
struct Portable {
  using T = Scalar;
  static constexpr int D = dimensions;
  static constexpr Spline spline = S;
  static bool available() { return true; }
};

template <typename T, int D, Spline S>
struct ByHomeBlocks : Portable<T, D, S> {
  static NodeSums sums(const SolverView<T>& view, T dt) {
    particle_to_grid(view, dt);
    return node_sums_of(view);
  }
};
template <typename T, int D, Spline S>
struct ByNodes : Portable<T, D, S> {
  static NodeSums sums(const SolverView<T>& view, T dt) {
    particle_to_grid_by_nodes(view, dt);
    return node_sums_of(view);
  }
};

template <typename T, InstructionSet set>
struct Vectorised : Portable<T, 3, Spline::quadratic> {
  static bool available() {
    const std::vector<InstructionSet> sets = available_instruction_sets();
    return std::find(sets.begin(), sets.end(), set) != sets.end();
  }
  static NodeSums sums(const SolverView<T>& view, T dt) {
    particle_to_grid_tuned(view, dt, set, GridParts::sums);
    return node_sums_of(view);
  }
};

/// The arenas of owner blocks, node for node.
struct GpuBlocks : Portable<float, 3, Spline::quadratic> {
  static NodeSums sums(const SolverView<float>& view, float dt) {
    using Shared = batch::ScatterShared<batch::block_warps>;
    NodeSums sums;
    const auto shared = std::make_unique<Shared>();
    std::vector<NodeSum> arena(halo_nodes);
    for (int32_t h = 0; h < view.blocks.owner_count; ++h) {
      OwnerBlock owner{};
      owner.at = view.grid.block_of(view.blocks.owner_key[h]);
      owner.begin = view.blocks.start[h];
      owner.end = view.blocks.start[h + 1];
      for (int32_t i = owner.begin; i < owner.end; ++i) EXPECT_EQ(view.blocks.order[i], i);
      FiberBlock(batch::block_threads).run(0, [&](const FiberThread& thread) {
        batch::scatter_block<batch::block_warps>(thread, view.particles, view, owner, dt, *shared, arena.data());
      });
      const Vec<int, 3> low = batch::halo_low(owner.at);
      for (int n = 0; n < halo_nodes; ++n) {
        const Vec<int, 3> c = {n / 64, n / 8 % 8, n % 8}, at = low + c;
        const NodeSum& node = arena[static_cast<std::size_t>(halo_index(c[0], c[1], c[2]))];
        if (node.v[3] == 0) continue;
        auto& sum = sums[{at[0], at[1], at[2]}];
        for (std::size_t k = 0; k < 4; ++k) sum[k] += static_cast<double>(node.v[k]);
      }
    }
    return sums;
  }
};

struct GpuSmallScene : Portable<float, 3, Spline::quadratic> {
  static NodeSums sums(const SolverView<float>& view, float dt) {
    SmallScene small{};
    small.count = static_cast<int32_t>(view.particles.count);
    small.nodes = block_width * view.grid.blocks;
    small.mass_unit = small.momentum_unit = std::ldexp(1.0f, -54);
    small.per_mass_unit = small.per_momentum_unit = std::ldexp(1.0f, 54);
    const int nodes = small.nodes[0] * small.nodes[1] * small.nodes[2];
    std::vector<UnitPair> grid(static_cast<std::size_t>(2 * nodes));
    small.sums[0] = grid.data();
    BatchScene scene{};
    scene.view = view;
    std::vector<int32_t> base(static_cast<std::size_t>(view.particles.count));
    SmallBatchView batch{};
    batch.scene_count = batch.groups = 1;
    batch.scenes = &scene;
    batch.small = &small;
    batch.particles = view.particles;
    batch.base = base.data();
    const auto shared = std::make_unique<small::Shared>();
    constexpr int threads = 64;
    FiberBlock(threads).run(0, [&](const FiberThread& thread) {
      small::load_scene(thread, batch, 0, *shared);
      const small::Worker<FiberThread, SmallBatchView> worker{thread,
                                                              batch,
                                                              *shared,
                                                              shared->scene,
                                                              shared->small,
                                                              0,
                                                              1,
                                                              0,
                                                              small::chunk_size_for(small.count, threads / warp_width),
                                                              dt};
      small::scatter_scene(worker, 0);
    });
    NodeSums sums;
    for (int n = 0; n < nodes; ++n) {
      const UnitPair &low = grid[static_cast<std::size_t>(2 * n)], &high = grid[static_cast<std::size_t>(2 * n + 1)];
      if (high.b == 0) continue;
      auto& sum =
          sums[{n / (small.nodes[1] * small.nodes[2]), n / small.nodes[2] % small.nodes[1], n % small.nodes[2]}];
      const long long units[] = {low.a, low.b, high.a, high.b};
      for (std::size_t k = 0; k < 4; ++k) sum[k] = std::ldexp(static_cast<double>(units[k]), -54);
    }
    return sums;
  }
};

using Schedules = testing::Types<ByHomeBlocks<float, 3, Spline::quadratic>, ByHomeBlocks<double, 3, Spline::quadratic>,
                                 ByHomeBlocks<float, 3, Spline::cubic>, ByHomeBlocks<double, 3, Spline::cubic>,
                                 ByHomeBlocks<float, 2, Spline::quadratic>, ByHomeBlocks<double, 2, Spline::quadratic>,
                                 ByHomeBlocks<float, 2, Spline::cubic>, ByHomeBlocks<double, 2, Spline::cubic>,
                                 ByNodes<float, 3, Spline::quadratic>, ByNodes<double, 3, Spline::quadratic>,
                                 ByNodes<double, 3, Spline::cubic>, ByNodes<float, 2, Spline::quadratic>,
                                 ByNodes<double, 2, Spline::cubic>, Vectorised<float, InstructionSet::baseline>,
                                 Vectorised<double, InstructionSet::baseline>, Vectorised<float, InstructionSet::avx2>,
                                 Vectorised<double, InstructionSet::avx2>, Vectorised<float, InstructionSet::avx512>,
                                 Vectorised<double, InstructionSet::avx512>, GpuBlocks, GpuSmallScene>;
INSTANTIATE_TYPED_TEST_SUITE_P(Solvers, ParticleToGrid, Schedules);

}  // namespace
}  // namespace graupel::mpm
