// P2G. On the CPU every home block sums its particles into its own arena, and every node then adds the arenas that
// cover it; on a GPU every node looks for its particles. Neither needs atomics, so the sums have a fixed order.
#include "mpm/phases.h"
#include "mpm/transfer.h"

namespace graupel::mpm {

namespace {

/// (m C - dt V0 (4 / dx^2) tau) dx: change of a particle's momentum over one cell.
template <typename T>
GRAUPEL_HD inline Mat<T, 3> affine_momentum(const SolverView<T>& view, int64_t slot, T mass, T dt) {
  const ParticleView<T>& p = view.particles;
  const T force = -dt * p.volume.get(slot) * T(4) * view.grid.inverse_dx;
  return (mass * view.grid.dx) * load_matrix<T, 3>(p.affine_velocity, slot) + force * load_symmetric(p.stress, slot);
}

template <typename T>
GRAUPEL_HD inline T mass_of(const SolverView<T>& view, int64_t slot) {
  return view.materials[view.particles.material.get(slot)].density * view.particles.volume.get(slot);
}

template <typename T>
struct ScatterBlock {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t home) const {
    T* arena = view.arenas + home * arena_size<3>;
    for (int i = 0; i < arena_size<3>; ++i) arena[i] = T(0);
    const Vec<int, 3> block = view.grid.block_of(view.blocks.home_key[home]);
    for (int32_t i = view.blocks.start[home]; i < view.blocks.start[home + 1]; ++i) {
      const int64_t slot = view.blocks.order[i];
      const T mass = mass_of(view, slot);
      const auto place = arena_place(view.grid.local(view.particles.position.vec(slot)), block);
      scatter_particle(arena, place, mass, mass * view.particles.velocity.vec(slot),
                       affine_momentum(view, slot, mass, dt));
    }
  }
};

/// Adds the arenas of the up to eight home blocks that reach into a node block.
template <typename T>
struct SumArenas {
  SolverView<T> view;
  GRAUPEL_HD void operator()(int64_t block) const {
    constexpr int row = block_width * channels;
    T* nodes = view.nodes + block * (nodes_per_block<3> * channels);
    for (int i = 0; i < nodes_per_block<3> * channels; ++i) nodes[i] = T(0);
    for (int corner = 0; corner < upper_neighbors<3>; ++corner) {
      const int32_t home = view.blocks.node_to_home[block * upper_neighbors<3> + corner];
      if (home < 0) continue;
      const T* arena = view.arenas + static_cast<int64_t>(home) * arena_size<3>;
      const Vec<int, 3> shift = block_width * corner_bits<3>(corner);
      const int nx = shift[0] > 0 ? arena_width - block_width : block_width;
      const int ny = shift[1] > 0 ? arena_width - block_width : block_width;
      const int length = (shift[2] > 0 ? arena_width - block_width : block_width) * channels;
      for (int x = 0; x < nx; ++x)
        for (int y = 0; y < ny; ++y) {
          const T* from = arena + arena_offset(Vec<int, 3>{x, y, 0} + shift);
          T* to = nodes + (x * block_width + y) * row;
          for (int l = 0; l < length; ++l) to[l] += from[l];
        }
    }
  }
};

/// Sums the particles within reach of one node, home block by home block.
template <typename T>
struct GatherNode {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t entry) const {
    const int64_t block = entry / nodes_per_block<3>;
    Vec<int, 3> node = node_in_block<3>(static_cast<int>(entry % nodes_per_block<3>));
    const Vec<int, 3> block_at = view.grid.block_of(view.blocks.node_key[block]);
    for (int d = 0; d < 3; ++d) node[d] += block_width * block_at[d];
    T sum[channels] = {};
    for (int corner = 0; corner < upper_neighbors<3>; ++corner) {
      const int32_t home = view.blocks.node_to_home[block * upper_neighbors<3> + corner];
      if (home < 0) continue;
      for (int32_t i = view.blocks.start[home]; i < view.blocks.start[home + 1]; ++i)
        add_particle(view.blocks.order[i], node, sum);
    }
    for (int c = 0; c < channels; ++c) view.nodes[entry * channels + c] = sum[c];
  }

  GRAUPEL_HD void add_particle(int64_t slot, const Vec<int, 3>& node, T (&sum)[channels]) const {
    const Vec<T, 3> local = view.grid.local(view.particles.position.vec(slot));
    Vec<T, 3> offset;
    T w = 1;
    for (int d = 0; d < 3; ++d) {
      offset[d] = T(node[d]) - local[d];
      if (!(std::abs(offset[d]) < T(1.5))) return;
      w *= bspline(offset[d]);
    }
    const T mass = mass_of(view, slot);
    const Vec<T, 3> q = mass * view.particles.velocity.vec(slot) + affine_momentum(view, slot, mass, dt) * offset;
    for (int c = 0; c < 3; ++c) sum[c] += w * q[c];
    sum[3] += w * mass;
  }
};

}  // namespace

template <typename T>
void particle_to_grid_by_nodes(const SolverView<T>& view, T dt) {
  launch<T>(view.device, view.blocks.node_count * int64_t(nodes_per_block<3>), GatherNode<T>{view, dt});
}

template <typename T>
void particle_to_grid(const SolverView<T>& view, T dt) {
  if (view.device != Device::cpu) return particle_to_grid_by_nodes(view, dt);
  parallel_for_cpu(view.blocks.home_count, ScatterBlock<T>{view, dt}, Grain{1});
  parallel_for_cpu(view.blocks.node_count, SumArenas<T>{view}, Grain{8});
}

template void particle_to_grid<float>(const SolverView<float>&, float);
template void particle_to_grid<double>(const SolverView<double>&, double);
template void particle_to_grid_by_nodes<float>(const SolverView<float>&, float);
template void particle_to_grid_by_nodes<double>(const SolverView<double>&, double);

}  // namespace graupel::mpm
