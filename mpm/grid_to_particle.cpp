// G2P. On the CPU every home block copies the nodes around it into an arena once; on a GPU every particle reads them.
#include "mpm/phases.h"
#include "mpm/transfer.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct GatherBlock {
  SolverView<T> view;

  /// Node velocities of the block and its upper neighbours, in arena layout.
  GRAUPEL_HD void load_arena(int64_t home, T* arena) const {
    constexpr int row = block_width * channels;
    for (int corner = 0; corner < upper_neighbors<3>; ++corner) {
      const int64_t block = view.blocks.home_to_node[home * upper_neighbors<3> + corner];
      const T* nodes = view.nodes + block * (nodes_per_block<3> * channels);
      const Vec<int, 3> shift = block_width * corner_bits<3>(corner);
      const int nx = shift[0] > 0 ? arena_width - block_width : block_width;
      const int ny = shift[1] > 0 ? arena_width - block_width : block_width;
      for (int x = 0; x < nx; ++x)
        for (int y = 0; y < ny; ++y) {
          T* to = arena + arena_offset(Vec<int, 3>{x, y, 0} + shift);
          const T* from = nodes + (x * block_width + y) * row;
          for (int l = 0; l < row; ++l) to[l] = from[l];
        }
    }
  }

  GRAUPEL_HD void operator()(int64_t home) const {
    alignas(64) T arena[arena_size<3>];
    load_arena(home, arena);
    const ParticleView<T>& p = view.particles;
    const Vec<int, 3> block = view.grid.block_of(view.blocks.home_key[home]);
    for (int32_t i = view.blocks.start[home]; i < view.blocks.start[home + 1]; ++i) {
      const int64_t slot = view.blocks.order[i];
      if (view.is_stationary(slot)) continue;
      const auto place = arena_place(view.grid.local(p.position.vec(slot)), block);
      Vec<T, 3> v;
      Mat<T, 3> C;
      gather_particle(arena, place, view.grid.inverse_dx, v, C);
      p.velocity.set_vec(slot, v);
      store_matrix<T, 3>(p.affine_velocity, slot, C);
    }
  }
};

/// One particle, from the nodes themselves.
template <typename T>
struct GatherParticle {
  SolverView<T> view;

  GRAUPEL_HD void operator()(int64_t slot) const {
    const ParticleView<T>& p = view.particles;
    if (view.keys[slot] < 0 || view.is_stationary(slot)) return;
    const int64_t home = view.blocks.home_of_key[view.keys[slot]];
    const Vec<int, 3> block = view.grid.block_of(view.blocks.home_key[home]);
    const auto place = arena_place(view.grid.local(p.position.vec(slot)), block);
    AxisWeights<T> weights[3];
    for (int d = 0; d < 3; ++d) weights[d] = bspline_weights(place.fx[d]);
    Vec<T, 3> v = Vec<T, 3>::zero();
    Mat<T, 3> C = Mat<T, 3>::zero();
    for (int x = 0; x < stencil_width; ++x)
      for (int y = 0; y < stencil_width; ++y)
        for (int z = 0; z < stencil_width; ++z) {
          const Vec<T, 3> v_i = node_velocity(home, place.base + Vec<int, 3>{x, y, z});
          const T w = weights[0].w[x] * weights[1].w[y] * weights[2].w[z];
          v += w * v_i;
          C += outer(w * v_i, Vec<T, 3>{T(x), T(y), T(z)} - place.fx);
        }
    p.velocity.set_vec(slot, v);
    store_matrix<T, 3>(p.affine_velocity, slot, (T(4) * view.grid.inverse_dx) * C);
  }

  GRAUPEL_HD Vec<T, 3> node_velocity(int64_t home, const Vec<int, 3>& c) const {
    int corner = 0, node = 0;
    for (int d = 0; d < 3; ++d) {
      corner |= (c[d] / block_width) << d;
      node = node * block_width + c[d] % block_width;
    }
    const int64_t block = view.blocks.home_to_node[home * upper_neighbors<3> + corner];
    const T* from = view.nodes + (block * nodes_per_block<3> + node) * channels;
    return {from[0], from[1], from[2]};
  }
};

}  // namespace

template <typename T>
void grid_to_particle_by_particles(const SolverView<T>& view) {
  launch<T>(view.device, view.particles.count, GatherParticle<T>{view});
}

template <typename T>
void grid_to_particle(const SolverView<T>& view) {
  if (view.device != Device::cpu) return grid_to_particle_by_particles(view);
  parallel_for_cpu(view.blocks.home_count, GatherBlock<T>{view}, Grain{1});
}

template void grid_to_particle<float>(const SolverView<float>&);
template void grid_to_particle<double>(const SolverView<double>&);
template void grid_to_particle_by_particles<float>(const SolverView<float>&);
template void grid_to_particle_by_particles<double>(const SolverView<double>&);

}  // namespace graupel::mpm
