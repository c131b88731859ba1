// G2P. On the CPU every owner block copies the nodes around it into an arena once; on a GPU every particle reads them.
#include "mpm/phases/phases.h"
#include "mpm/phases/transfer_form.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm {

namespace {

template <typename T, typename Form>
struct GatherBlock {
  static constexpr int D = Form::D;
  static constexpr Spline S = Form::spline;
  SolverView<T> view;

  /// Node velocities of the block and its upper neighbours, in arena layout.
  GRAUPEL_HD void load_arena(int64_t owner, T* arena) const {
    for (int corner = 0; corner < upper_neighbors<D>; ++corner) {
      const int64_t block = view.blocks.owner_to_node[owner * upper_neighbors<D> + corner];
      const T* nodes = view.nodes + block * (nodes_per_block<D> * channels);
      for_each_arena_row<Form>(corner, [&](int offset, int node, auto) {
        T* to = arena + offset;
        const T* from = nodes + node * channels;
        for (int l = 0; l < block_width * channels; ++l) to[l] = from[l];
      });
    }
  }

  GRAUPEL_HD void operator()(int64_t owner) const {
    alignas(64) T arena[arena_size<D, S>];
    load_arena(owner, arena);
    const ParticleView<T>& p = view.particles;
    const GridGeometry<T, D> grid = in_axes<D>(view.grid);
    const Vec<int, D> block = grid.block_of(view.blocks.owner_key[owner]);
    for (int32_t i = view.blocks.start[owner]; i < view.blocks.start[owner + 1]; ++i) {
      const int64_t slot = view.blocks.order[i];
      if (view.is_stationary(slot)) continue;
      const auto stencil = arena_stencil<S>(grid.local(in_axes<D>(p.position.vec(slot))), block);
      Vec<T, D> v;
      Mat<T, D> C;
      gather_particle<S>(arena, stencil, view.grid.inverse_dx, v, C);
      p.velocity.set_vec(slot, in_space(v));
      store_matrix<T, 3>(p.affine_velocity, slot, in_space(C));
    }
  }
};

/// One particle, from the nodes themselves.
template <typename T, typename Form>
struct GatherParticle {
  static constexpr int D = Form::D;
  static constexpr Spline S = Form::spline;
  SolverView<T> view;

  GRAUPEL_HD void operator()(int64_t slot) const {
    const ParticleView<T>& p = view.particles;
    if (view.keys[slot] < 0 || view.is_stationary(slot)) return;
    const int64_t owner = view.blocks.owner_of_key[view.keys[slot]];
    const GridGeometry<T, D> grid = in_axes<D>(view.grid);
    const Vec<int, D> block = grid.block_of(view.blocks.owner_key[owner]);
    const auto stencil = arena_stencil<S>(grid.local(in_axes<D>(p.position.vec(slot))), block);
    AxisWeights<T, S> weights[D];
    for (int d = 0; d < D; ++d) weights[d] = bspline_weights<S>(stencil.fx[d]);
    Vec<T, 3> v = Vec<T, 3>::zero();
    Mat<T, 3> C = Mat<T, 3>::zero();
    for (int row = 0; row < stencil_rows<D, S>; ++row) {
      Vec<int, D> node;
      const T row_w = row_weight(weights, row, node);
      for (int k = 0; k < stencil_width<S>; ++k) {
        node[D - 1] = k;
        const Vec<T, 3> v_i = node_velocity(owner, stencil.base + node);
        const T w = row_w * weights[D - 1].w[k];
        v += w * v_i;
        C += outer(w * v_i, in_space(node.template cast<T>() - stencil.fx));
      }
    }
    p.velocity.set_vec(slot, v);
    store_matrix<T, 3>(p.affine_velocity, slot, (T(BSpline<S>::inverse_moment) * view.grid.inverse_dx) * C);
  }

  GRAUPEL_HD Vec<T, 3> node_velocity(int64_t owner, const Vec<int, D>& c) const {
    int corner = 0, node = 0;
    for (int d = 0; d < D; ++d) {
      corner |= (c[d] / block_width) << d;
      node = node * block_width + c[d] % block_width;
    }
    const int64_t block = view.blocks.owner_to_node[owner * upper_neighbors<D> + corner];
    const T* from = view.nodes + (block * nodes_per_block<D> + node) * channels;
    return {from[0], from[1], from[2]};
  }
};

}  // namespace

template <typename T>
void grid_to_particle_by_particles(const SolverView<T>& view) {
  with_form(view,
            [&](auto form) { launch<T>(view.device, view.particles.count, GatherParticle<T, decltype(form)>{view}); });
}

template <typename T>
void grid_to_particle(const SolverView<T>& view) {
  if (view.device != Device::cpu) return grid_to_particle_by_particles(view);
  with_form(view, [&](auto form) {
    parallel_for_cpu(view.blocks.owner_count, GatherBlock<T, decltype(form)>{view}, Grain{1});
  });
}

template <typename T>
void grid_to_particle_slots(const SolverView<T>& view, int64_t count) {
  with_form(view, [&](auto form) { parallel_for_cpu(count, GatherParticle<T, decltype(form)>{view}); });
}

template void grid_to_particle_slots<float>(const SolverView<float>&, int64_t);
template void grid_to_particle_slots<double>(const SolverView<double>&, int64_t);
template void grid_to_particle<float>(const SolverView<float>&);
template void grid_to_particle<double>(const SolverView<double>&);
template void grid_to_particle_by_particles<float>(const SolverView<float>&);
template void grid_to_particle_by_particles<double>(const SolverView<double>&);

}  // namespace graupel::mpm
