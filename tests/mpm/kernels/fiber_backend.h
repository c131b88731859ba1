// Runs a BatchSolver's kernels on the CPU, with fibers for threads.
#pragma once

#include <algorithm>
#include <cstring>
#include <numeric>

#include "mpm/gpu/blocks/batch_solver.h"
#include "mpm/gpu/small/small_scene_solver.h"
#include "tests/fiber_block.h"

namespace graupel::mpm {

class FiberBackend {
 public:
  using Atomics = FiberAtomics;

  Device device() const { return Device::cpu; }
  /// Home blocks that may run a segment at once: none by default, so that the three kernels run.
  explicit FiberBackend(int resident_blocks = 0) : resident_blocks_(resident_blocks) {}
  int resident_blocks() const { return resident_blocks_; }
  void reserve(int64_t, int64_t) {}
  void forget() {}
  void wait() {}
  template <typename Record>
  void segment(int, const Record& record) {
    record();
  }
  template <typename Body>
  void launch(int64_t n, const Body& body) {
    for (int64_t i = 0; i < n; ++i) body(i);
  }
  void fill(void* data, int value, std::size_t bytes) { std::memset(data, value, bytes); }
  void sort_pairs(const uint32_t* key, uint32_t* sorted_key, const int32_t* value, int32_t* sorted_value, int64_t n,
                  uint64_t /*keys*/) {
    std::vector<int32_t> order(static_cast<std::size_t>(n));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return key[a] < key[b]; });
    for (std::size_t i = 0; i < order.size(); ++i) {
      sorted_key[i] = key[order[i]];
      sorted_value[i] = value[order[i]];
    }
  }
  void select_marked(const uint8_t* marked, int64_t n, int32_t* selected, int32_t* count) {
    *count = 0;
    for (int64_t i = 0; i < n; ++i)
      if (marked[i]) selected[(*count)++] = static_cast<int32_t>(i);
  }
  void particle_to_grid(const BatchView& view) {
    using Shared = batch::ScatterShared<batch::block_warps>;
    run<Shared>(view, [](const FiberThread& block, const BatchView& v, Shared& shared) {
      batch::particle_to_grid(block, v, shared);
    });
  }
  void update_grid(const BatchView& view) {
    for (int64_t i = 0; i < int64_t(view.node_capacity) * nodes_per_block<3>; ++i) batch::update_node(view, i);
  }
  void grid_to_particle(const BatchView& view) {
    run<batch::GatherShared>(view, [](const FiberThread& block, const BatchView& v, batch::GatherShared& shared) {
      batch::grid_to_particle(block, v, shared);
    });
  }

  template <typename A, typename B>
  void read(const A* a, std::size_t n, A* to_a, const B* b, std::size_t m, B* to_b) {
    std::copy_n(a, n, to_a);
    std::copy_n(b, m, to_b);
  }
  void list_owners(const BatchView& view) {
    batch::ListShared shared;
    std::memset(static_cast<void*>(&shared), 0xa5, sizeof(shared));
    FiberBlock(batch::list_threads).run(0, [&](const FiberThread& thread) {
      batch::list_owners(thread, view, shared);
    });
  }
  void run_segment(const BatchView& view) {
    const int blocks = std::min(resident_blocks_, view.counts->owner + 1);  // one too many, which does nothing
    run_together<batch::ResidentShared>(blocks, resident_blocks_, batch::resident_threads,
                                        [&view](const FiberThread& thread, batch::ResidentShared& shared) {
                                          batch::run_segment(thread, view, shared);
                                        });
  }
  static constexpr int small_threads = 64;
  static int small_warps() { return small_threads / warp_width; }
  int small_blocks() const { return 4; }
  template <typename View>
  void run_frame(const View& view, int blocks) {
    using Shared = small::SharedFor<View>;
    run_together<Shared>(blocks, blocks, small_threads, [&view](const FiberThread& thread, Shared& shared) {
      small::run_frame(thread, view, shared);
    });
  }

 private:
  /// All blocks take turns, since they wait for each other.
  template <typename Shared, typename Kernel>
  void run_together(int blocks, int blocks_in_grid, int threads, const Kernel& kernel) {
    struct Grid {
      std::unique_ptr<FiberBlock> block;
      std::unique_ptr<Shared> shared;
      FiberBlock::Kernel kernel;
      bool done = false;
    };
    std::vector<Grid> grid(static_cast<std::size_t>(blocks));
    for (std::size_t i = 0; i < grid.size(); ++i) {
      Grid& g = grid[i];
      g.block = std::make_unique<FiberBlock>(threads);
      g.shared = std::make_unique<Shared>();
      std::memset(static_cast<void*>(g.shared.get()), 0xa5, sizeof(Shared));
      g.kernel = [&g, &kernel](const FiberThread& thread) { kernel(thread, *g.shared); };
      g.block->begin(static_cast<int>(i), blocks_in_grid, g.kernel);
    }
    for (bool running = true; running;) {
      running = false;
      for (Grid& g : grid) {
        if (!g.done) g.done = g.block->go_on();
        running = running || !g.done;
      }
    }
  }
  template <typename Shared, typename Kernel>
  void run(const BatchView& view, const Kernel& kernel) {
    const auto shared = std::make_unique<Shared>();
    const int blocks = std::min(view.owner_capacity, view.counts->owner + 1);  // one block too many must do nothing
    for (int i = 0; i < blocks; ++i) {
      std::memset(static_cast<void*>(shared.get()), 0xa5, sizeof(Shared));  // shared memory starts undefined
      block_.run(i, [&](const FiberThread& thread) { kernel(thread, view, *shared); });
    }
  }
  int resident_blocks_;
  FiberBlock block_{batch::block_threads};
};

}  // namespace graupel::mpm
