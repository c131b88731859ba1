// P2G. On the CPU every owner block sums its particles into its own arena, and every node then adds the arenas that
// cover it; on a GPU every node looks for its particles. Neither needs atomics, so the sums have a fixed order.
#include "mpm/phases/phases.h"
#include "mpm/phases/transfer_form.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm {

namespace {

/// affine_momentum() of the particle in a slot.
template <typename Form, typename T>
GRAUPEL_HD inline Mat<T, Form::D> affine_momentum_of(const SolverView<T>& view, int64_t slot, T mass, T dt) {
  constexpr int D = Form::D;
  const ParticleView<T>& p = view.particles;
  return affine_momentum<Form::spline>(mass, p.volume.get(slot), dt, view.grid.dx, view.grid.inverse_dx,
                                       in_axes<D>(load_matrix<T, 3>(p.affine_velocity, slot)),
                                       in_axes<D>(load_symmetric(p.stress, slot)));
}

template <typename T>
GRAUPEL_HD inline T mass_of(const SolverView<T>& view, int64_t slot) {
  return view.materials[view.particles.material.get(slot)].density * view.particles.volume.get(slot);
}

template <typename T, typename Form>
struct ScatterBlock {
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t owner) const {
    constexpr int D = Form::D;
    constexpr Spline S = Form::spline;
    T* arena = view.arenas + owner * arena_size<D, S>;
    for (int i = 0; i < arena_size<D, S>; ++i) arena[i] = T(0);
    const GridGeometry<T, D> grid = in_axes<D>(view.grid);
    const Vec<int, D> block = grid.block_of(view.blocks.owner_key[owner]);
    for (int32_t i = view.blocks.start[owner]; i < view.blocks.start[owner + 1]; ++i) {
      const int64_t slot = view.blocks.order[i];
      const T mass = mass_of(view, slot);
      const auto stencil = arena_stencil<S>(grid.local(in_axes<D>(view.particles.position.vec(slot))), block);
      scatter_particle<S>(arena, stencil, mass, mass * in_axes<D>(view.particles.velocity.vec(slot)),
                          affine_momentum_of<Form>(view, slot, mass, dt));
    }
  }
};

/// Adds the arenas of the owner blocks that reach into a node block: up to four in the plane, eight in space.
template <typename T, typename Form>
struct SumArenas {
  SolverView<T> view;
  GRAUPEL_HD void operator()(int64_t block) const {
    constexpr int D = Form::D;
    T* nodes = view.nodes + block * (nodes_per_block<D> * channels);
    for (int i = 0; i < nodes_per_block<D> * channels; ++i) nodes[i] = T(0);
    for (int corner = 0; corner < upper_neighbors<D>; ++corner) {
      const int32_t owner = view.blocks.node_to_owner[block * upper_neighbors<D> + corner];
      if (owner < 0) continue;
      const T* arena = view.arenas + static_cast<int64_t>(owner) * arena_size<D, Form::spline>;
      for_each_arena_row<Form>(corner, [&](int offset, int node, auto count) {
        const T* from = arena + offset;
        T* to = nodes + node * channels;
        for (int l = 0; l < decltype(count)::value * channels; ++l) to[l] += from[l];
      });
    }
  }
};

/// Sums the particles whose stencils contain one node, owner block by owner block.
template <typename T, typename Form>
struct GatherNode {
  static constexpr int D = Form::D;
  static constexpr Spline S = Form::spline;
  SolverView<T> view;
  T dt;
  GRAUPEL_HD void operator()(int64_t entry) const {
    const int64_t block = entry / nodes_per_block<D>;
    Vec<int, D> node = node_in_block<D>(static_cast<int>(entry % nodes_per_block<D>));
    const Vec<int, D> block_at = in_axes<D>(view.grid).block_of(view.blocks.node_key[block]);
    for (int d = 0; d < D; ++d) node[d] += block_width * block_at[d];
    T sum[channels] = {};
    for (int corner = 0; corner < upper_neighbors<D>; ++corner) {
      const int32_t owner = view.blocks.node_to_owner[block * upper_neighbors<D> + corner];
      if (owner < 0) continue;
      for (int32_t i = view.blocks.start[owner]; i < view.blocks.start[owner + 1]; ++i)
        add_particle(view.blocks.order[i], node, sum);
    }
    for (int c = 0; c < channels; ++c) view.nodes[entry * channels + c] = sum[c];
  }

  GRAUPEL_HD void add_particle(int64_t slot, const Vec<int, D>& node, T (&sum)[channels]) const {
    const Vec<T, D> local = in_axes<D>(view.grid.local(view.particles.position.vec(slot)));
    Vec<T, D> offset;
    T w = 1;
    for (int d = 0; d < D; ++d) {
      offset[d] = T(node[d]) - local[d];
      if (!(std::abs(offset[d]) < T(BSpline<S>::half_support))) return;
      w *= bspline<S>(offset[d]);
    }
    const T mass = mass_of(view, slot);
    const Vec<T, D> q =
        mass * in_axes<D>(view.particles.velocity.vec(slot)) + affine_momentum_of<Form>(view, slot, mass, dt) * offset;
    for (int c = 0; c < D; ++c) sum[c] += w * q[c];
    sum[3] += w * mass;
  }
};

}  // namespace

template <typename T>
void particle_to_grid_by_nodes(const SolverView<T>& view, T dt) {
  with_form(view, [&](auto form) {
    using Form = decltype(form);
    launch<T>(view.device, view.blocks.node_count * int64_t(nodes_per_block<Form::D>), GatherNode<T, Form>{view, dt});
  });
}

template <typename T>
void particle_to_grid(const SolverView<T>& view, T dt) {
  if (view.device != Device::cpu) return particle_to_grid_by_nodes(view, dt);
  with_form(view, [&](auto form) {
    using Form = decltype(form);
    parallel_for_cpu(view.blocks.owner_count, ScatterBlock<T, Form>{view, dt}, Grain{1});
    parallel_for_cpu(view.blocks.node_count, SumArenas<T, Form>{view}, Grain{8});
  });
}

template void particle_to_grid<float>(const SolverView<float>&, float);
template void particle_to_grid<double>(const SolverView<double>&, double);
template void particle_to_grid_by_nodes<float>(const SolverView<float>&, float);
template void particle_to_grid_by_nodes<double>(const SolverView<double>&, double);

}  // namespace graupel::mpm
