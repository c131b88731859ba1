#include "mpm/cpu/cpu_step.h"

#include "core/parallel/instruction_set.h"
#include "mpm/cpu/tuned_phases.h"
#include "mpm/particles/slot_range.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

// The tables that kernels.cpp defines, once for each instruction set.
#define GRAUPEL_TABLES(isa)                    \
  namespace isa {                              \
  extern const CpuKernels<float> kernels_f32;  \
  extern const CpuKernels<double> kernels_f64; \
  }
GRAUPEL_TABLES(baseline)
#ifdef GRAUPEL_X86_KERNELS
GRAUPEL_TABLES(avx2)
GRAUPEL_TABLES(avx512)
#endif
#undef GRAUPEL_TABLES

template <>
const CpuKernels<float>& cpu_kernels<float>(InstructionSet set) {
#ifdef GRAUPEL_X86_KERNELS
  if (set == InstructionSet::avx512) return avx512::kernels_f32;
  if (set == InstructionSet::avx2) return avx2::kernels_f32;
#endif
  static_cast<void>(set);
  return baseline::kernels_f32;
}
template <>
const CpuKernels<double>& cpu_kernels<double>(InstructionSet set) {
#ifdef GRAUPEL_X86_KERNELS
  if (set == InstructionSet::avx512) return avx512::kernels_f64;
  if (set == InstructionSet::avx2) return avx2::kernels_f64;
#endif
  static_cast<void>(set);
  return baseline::kernels_f64;
}

namespace {

template <typename T>
const SolverView<T>& view_of(const void* view) {
  return *static_cast<const SolverView<T>*>(view);
}

template <typename T>
CpuStep<T> cpu_step(const SolverView<T>& v, T dt) {
  const ParticleView<T>& p = v.particles;
  CpuStep<T> s{};
  s.dt = dt;
  s.count = p.count;
  s.position = p.position.data;
  s.velocity = p.velocity.data;
  s.affine_velocity = p.affine_velocity.data;
  s.deformation_gradient = p.deformation_gradient.data;
  s.stress = p.stress.data;
  s.internal = p.internal.data;
  s.volume = p.volume.data;
  s.material = p.material.data;
  s.materials = v.materials;
  s.some_stationary = v.some_stationary;
  s.dx = v.grid.dx;
  s.inverse_dx = v.grid.inverse_dx;
  for (int d = 0; d < 3; ++d) {
    s.origin[d] = v.grid.origin[d];
    s.blocks[d] = v.grid.blocks[d];
    s.particle_low[d] = v.walls.particle_low[d];
    s.particle_high[d] = v.walls.particle_high[d];
  }
  for (int d = 0; d < 3; ++d) {
    s.gravity[d] = v.gravity[d];
    s.wall_low[d] = v.walls.low[d];
    s.wall_high[d] = v.walls.high[d];
  }
  s.node_key = v.blocks.node_key;
  s.node_surfaces = v.obstacle_nodes.block_number;
  s.obstacles_move = v.moving.count > 0;
  s.owner_key = v.blocks.owner_key;
  s.owner_to_node = v.blocks.owner_to_node;
  s.node_to_owner = v.blocks.node_to_owner;
  s.owner_of_key = v.blocks.owner_of_key;
  s.start = v.blocks.start;
  s.order = v.blocks.order;
  s.arenas = v.arenas;
  s.nodes = v.nodes;
  s.keys = v.keys;
  s.keys_changed = v.keys_changed;
  s.surface_blocks = v.push_out && v.obstacle_nodes.obstacles.count > 0 ? v.obstacle_nodes.block_number : nullptr;
  s.view = &v;
  s.deform_slots = [](const void* view, T step, int64_t first, int64_t end) {
    update_deformation_slots(view_of<T>(view), step, first, end);
  };
  s.update_block = [](const void* view, T step, int64_t block) { update_grid_block(view_of<T>(view), step, block); };
  s.touches_moving_obstacle = [](const void* view, int32_t key) {
    return touches_moving_obstacle(view_of<T>(view), key);
  };
  s.move_slots = [](const void* view, T step, int64_t first, int64_t end, StepStatistics& found) {
    move_slots(view_of<T>(view), step, first, end, found);
  };
  s.statistics_slots = [](const void* view, T step, int64_t first, int64_t end, StepStatistics& found) {
    statistics_slots(view_of<T>(view), step, first, end, found);
  };
  return s;
}

}  // namespace

template <typename T>
void particle_to_grid_tuned(const SolverView<T>& view, T dt, InstructionSet set, GridParts parts) {
  const CpuKernels<T>& kernels = cpu_kernels<T>(set);
  const CpuStep<T> step = cpu_step(view, dt);
  parallel_for_cpu(
      view.blocks.owner_count, [&](int64_t owner) { kernels.scatter(step, owner); }, Grain{1});
  parallel_for_cpu(
      view.blocks.node_count,
      [&](int64_t block) {
        kernels.sum_arenas(step, block);
        if (parts == GridParts::velocities) kernels.update_nodes(step, block);
      },
      Grain{8});
}

template <typename T>
void update_grid_tuned(const SolverView<T>& view, T dt, InstructionSet set) {
  const CpuKernels<T>& kernels = cpu_kernels<T>(set);
  const CpuStep<T> step = cpu_step(view, dt);
  parallel_for_cpu(
      view.blocks.node_count, [&](int64_t block) { kernels.update_nodes(step, block); }, Grain{8});
}

template <typename T>
StepStatistics advance_tuned(const SolverView<T>& view, T dt, AdvanceParts parts, Buffer<StepStatistics>& records,
                             InstructionSet set) {
  if (view.blocks.owner_count == 0) return {};
  const CpuKernels<T>& kernels = cpu_kernels<T>(set);
  const CpuStep<T> step = cpu_step(view, dt);
  const int64_t items = (view.particles.count + slots_per_record - 1) / slots_per_record;
  records.resize_discard(static_cast<std::size_t>(2 * items));
  parallel_for_cpu(
      view.blocks.owner_count, [&](int64_t owner) { kernels.fill_arena(step, owner); }, Grain{8});
  parallel_for_cpu(
      items,
      [&](int64_t item) {
        StepStatistics found;
        kernels.advance(step, parts, item, found);
        records[static_cast<std::size_t>(item)] = found;
      },
      Grain{2});
  return total(view.device, records, items);
}

#define GRAUPEL_INSTANTIATE(T)                                                                             \
  template void particle_to_grid_tuned<T>(const SolverView<T>&, T, InstructionSet, GridParts);             \
  template void update_grid_tuned<T>(const SolverView<T>&, T, InstructionSet);                             \
  template StepStatistics advance_tuned<T>(const SolverView<T>&, T, AdvanceParts, Buffer<StepStatistics>&, \
                                           InstructionSet);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
