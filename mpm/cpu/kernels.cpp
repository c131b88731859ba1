// The substep's hot loops for one instruction set (compiled once for each, with GRAUPEL_ISA its name): P2G into arenas,
// sums and grid update, and one pass over the particles that does G2P, deformation, return mapping, stress, motion,
// owner blocks and step_statistics while their state is in registers.
// Equals the phases of mpm/phases/ (particle_to_grid, update_grid, grid_to_particle, update_deformation,
// move_particles), which pass over all particles four times. Gain, ns a particle (Zen 4, f32, AVX-512): water 93 -> 48,
// jelly 150 -> 52, snow 153 -> 63, sand 184 -> 63 (docs/decisions/0006-cpu-tuning.md).
#include "mpm/cpu/cpu_step.h"
#include "mpm/cpu/lanes_gather.h"
#include "mpm/cpu/lanes_materials.h"
#include "mpm/cpu/lanes_motion.h"
#include "mpm/cpu/lanes_scatter.h"
#include "mpm/physics/node_update.h"

namespace graupel::mpm {
namespace {

constexpr int arena_numbers = arena_size<3>, node_numbers = nodes_per_block<3> * channels, corner_count = 8;
constexpr int node_row = block_width * channels;  ///< numbers in a row of a node block

/// Lowest node of the block with a directory index.
template <typename T>
GRAUPEL_LANES void block_low(const CpuStep<T>& s, int32_t key, int32_t (&low)[3]) {
  for (int d = 2; d >= 0; --d) {
    low[d] = block_width * (key % s.blocks[d]);
    key /= s.blocks[d];
  }
}

template <typename T>
[[gnu::flatten]] void scatter(const CpuStep<T>& s, int64_t owner) {
  T* arena = s.arenas + owner * arena_numbers;
  for (int i = 0; i < arena_numbers; i += width<T>) store(arena + i, Lanes<T>{});
  int32_t low[3];
  block_low(s, s.owner_key[owner], low);
  const Ints<T> lows[3] = {Ints<T>{} + low[0], Ints<T>{} + low[1], Ints<T>{} + low[2]};
  ScatterTile<T> work;
  int64_t prepared = -1;
  for (int32_t i = s.start[owner]; i < s.start[owner + 1]; ++i) {
    const int32_t slot = s.order[i];
    if (slot / tile_lanes != prepared) {
      prepared = slot / tile_lanes;
      prepare_scatter(s, prepared, lows, work);
    }
    scatter_one(work, slot % tile_lanes, arena);
  }
}

/// Rows that an arena and the node block at its corner `c` share; body(row in the arena, row in the block, its length).
template <typename Body>
GRAUPEL_LANES void for_shared_rows(int c, Body body) {
  const int x0 = (c & 1) * block_width, y0 = (c >> 1 & 1) * block_width, z0 = (c >> 2 & 1) * block_width;
  const int nx = x0 > 0 ? arena_width<> - block_width : block_width,
            ny = y0 > 0 ? arena_width<> - block_width : block_width;
  const int nz = z0 > 0 ? arena_width<> - block_width : block_width;
  for (int x = 0; x < nx; ++x)
    for (int y = 0; y < ny; ++y)
      body((((x0 + x) * arena_width<> + y0 + y) * arena_row + z0) * channels, (x * block_width + y) * node_row, nz);
}

template <typename T>
void sum_arenas(const CpuStep<T>& s, int64_t node_block) {
  T* nodes = s.nodes + node_block * node_numbers;
  for (int i = 0; i < node_numbers; i += width<T>) store(nodes + i, Lanes<T>{});
  for (int c = 0; c < corner_count; ++c) {
    const int32_t owner = s.node_to_owner[node_block * corner_count + c];
    if (owner < 0) continue;
    const T* arena = s.arenas + int64_t(owner) * arena_numbers;
    for_shared_rows(c, [&](int from, int to, int length) {
      for (int z = 0; z < length; ++z) {
        T* at = nodes + to + z * channels;
        store(at, load_as<Node<T>>(at) + load_as<Node<T>>(arena + from + z * channels));
      }
    });
  }
}

/// Whether no wall and no obstacle acts on a block's nodes.
template <typename T>
GRAUPEL_LANES bool is_free(const CpuStep<T>& s, int32_t key) {
  if (s.node_surfaces[key] >= 0 || (s.obstacles_move && s.touches_moving_obstacle(s.view, key))) return false;
  int32_t low[3];
  block_low(s, key, low);
  bool inside = true;
  for (int d = 0; d < 3; ++d) {
    const T first = s.origin[d] + static_cast<T>(low[d]) * s.dx, last = first + (block_width - 1) * s.dx;
    inside = inside && first > s.wall_low[d] + T(0.5) * s.dx && last < s.wall_high[d] - T(0.5) * s.dx;
  }
  return inside;
}

template <typename T>
void update_nodes(const CpuStep<T>& s, int64_t node_block) {
  if (!is_free(s, s.node_key[node_block])) return s.update_block(s.view, s.dt, node_block);
  T* nodes = s.nodes + node_block * node_numbers;
  const Node<T> gravity = {s.dt * s.gravity[0], s.dt * s.gravity[1], s.dt * s.gravity[2], T(0)};
  const Pack<T> gain = repeated<T>(gravity);
  const Lanes<T> is_mass = repeated<T>(Node<T>{T(0), T(0), T(0), T(1)});
  for (int i = 0; i < node_numbers; i += width<T>) {
    const Lanes<T> sums = load(nodes + i), mass = last_channel(sums);
    const Pack<T> velocity = free_velocity(Pack<T>(sums), T(1) / Pack<T>(mass), gain);
    store(nodes + i, is_mass != T(0) ? sums : mass >= least_node_mass<T> ? velocity.v : Lanes<T>{});
  }
}

template <typename T>
void fill_arena(const CpuStep<T>& s, int64_t owner) {
  T* arena = s.arenas + owner * arena_numbers;
  for (int c = 0; c < corner_count; ++c) {
    const T* nodes = s.nodes + int64_t(s.owner_to_node[owner * corner_count + c]) * node_numbers;
    // A whole row, so that also the padding, which has weight 0, is a number.
    for_shared_rows(c, [&](int to, int from, int) {
      for (int i = 0; i < node_row; i += 4) store(arena + to + i, load_as<Node<T>>(nodes + from + i));
    });
  }
}

/// Where the particles of a tile live.
template <typename T>
struct TileOwners {
  int lanes;     ///< particles in the tile
  bool uniform;  ///< 16 particles in motion, of one material
  bool keeps_some;
  alignas(64) int32_t low[3][tile_lanes];  ///< lowest nodes of the owner blocks
  const T* arena[tile_lanes];
  alignas(64) T keeps[tile_lanes];  ///< not 0 for lanes that keep their velocity

  GRAUPEL_LANES_MEMBER void low_of(int lane, Ints<T> (&lows)[3]) const {
    for (int d = 0; d < 3; ++d) lows[d] = load_as<Ints<T>>(low[d] + lane);
  }
};

/// The owner block looked up last: neighbours in memory mostly share it.
struct KnownOwner {
  int32_t key = -1, low[3] = {0, 0, 0};
  int64_t owner = 0;
};

template <typename T>
GRAUPEL_LANES void find_owners(const CpuStep<T>& s, int64_t tile_index, KnownOwner& known, TileOwners<T>& owners) {
  const int64_t first = tile_index * tile_lanes;
  owners.lanes = s.count - first < tile_lanes ? static_cast<int>(s.count - first) : tile_lanes;
  owners.uniform = owners.lanes == tile_lanes;
  owners.keeps_some = !owners.uniform;
  for (int l = 0; l < tile_lanes; ++l) {
    const int32_t key = l < owners.lanes ? s.keys[first + l] : -1;
    const bool rests =
        key >= 0 && s.some_stationary && s.materials[s.material[first + l]].model == MaterialModel::stationary;
    owners.keeps[l] = T(key < 0 || rests);
    owners.keeps_some = owners.keeps_some || key < 0 || rests;
    if (key >= 0 && key != known.key) {
      known.key = key;
      known.owner = s.owner_of_key[key];
      block_low(s, key, known.low);
    }
    for (int d = 0; d < 3; ++d) owners.low[d][l] = known.low[d];
    owners.arena[l] = s.arenas + known.owner * arena_numbers;
  }
  for (int l = 1; l < owners.lanes; ++l) owners.uniform = owners.uniform && s.material[first + l] == s.material[first];
  owners.uniform = owners.uniform && !owners.keeps_some;
}

/// Velocity and affine velocity of the particles from `lane` on, into C and into memory.
template <typename T>
GRAUPEL_LANES void take_velocity(const CpuStep<T>& s, const GatherTile<T>& work, const TileOwners<T>& owners,
                                 int64_t tile_index, int lane, LaneMotion<T>& motion) {
  Lanes<T>(&v)[3] = motion.v;
  load_by_lane<T>(work.velocity + 4 * lane, v[0], v[1], v[2]);
  const T scale = T(4) * s.inverse_dx;
  for (int c = 0; c < 3; ++c) {
    Lanes<T> column[3];
    load_by_lane<T>(work.column[c] + 4 * lane, column[0], column[1], column[2]);
    for (int r = 0; r < 3; ++r) motion.C.m[r][c] = scale * column[r];
  }
  if (owners.keeps_some) {
    const Mask<T> keep = load(owners.keeps + lane) != T(0);
    for (int d = 0; d < 3; ++d) v[d] = keep ? component<T, 3>(s.velocity, tile_index, d, lane) : v[d];
    for (int k = 0; k < 9; ++k) {
      Lanes<T>& entry = motion.C.m[k / 3][k % 3];
      entry = keep ? component<T, 9>(s.affine_velocity, tile_index, k, lane) : entry;
    }
  }
  for (int d = 0; d < 3; ++d) set_component<T, 3>(s.velocity, tile_index, d, lane, v[d]);
  for (int k = 0; k < 9; ++k) set_component<T, 9>(s.affine_velocity, tile_index, k, lane, motion.C.m[k / 3][k % 3]);
}

/// New deformation and stress, in memory as well; false, with nothing stored, where a lane is special.
template <typename T, typename Law>
GRAUPEL_LANES bool deform(const CpuStep<T>& s, const MaterialParameters<T>& m, int64_t tile_index, int lane,
                          const LaneMatrix<T>& C, LaneState<T>& state) {
  constexpr bool keeps_F = Law::measure != Measure::volume_ratio;
  state.internal = component<T, 1>(s.internal, tile_index, 0, lane);
  if constexpr (keeps_F)
    for (int k = 0; k < 9; ++k) state.F.m[k / 3][k % 3] = component<T, 9>(s.deformation_gradient, tile_index, k, lane);
  step_material<Law>(m, s.dt, C, state);
  if (any(state.special)) return false;
  if constexpr (keeps_F)
    for (int k = 0; k < 9; ++k)
      set_component<T, 9>(s.deformation_gradient, tile_index, k, lane, state.F.m[k / 3][k % 3]);
  set_component<T, 1>(s.internal, tile_index, 0, lane, state.internal);
  for (int k = 0; k < 6; ++k) set_component<T, 6>(s.stress, tile_index, k, lane, state.tau.s[k]);
  return true;
}

/// A tile of one material after its gather.
template <typename T, typename Law>
GRAUPEL_LANES void finish_tile(const CpuStep<T>& s, AdvanceParts parts, const GatherTile<T>& work,
                               const TileOwners<T>& owners, int64_t tile_index, LaneStepStatistics<T>& step_statistics,
                               StepStatistics& found) {
  const MaterialParameters<T>& m = s.materials[s.material[tile_index * tile_lanes]];
  for (int lane = 0; lane < tile_lanes; lane += width<T>) {
    const int64_t first = tile_index * tile_lanes + lane, end = first + width<T>;
    LaneMotion<T> motion;
    take_velocity(s, work, owners, tile_index, lane, motion);
    LaneState<T> state;
    const bool deformed = deform<T, Law>(s, m, tile_index, lane, motion.C, state);
    if (!deformed) s.deform_slots(s.view, s.dt, first, end);
    if (parts != AdvanceParts::all) continue;
    if (!move(s, tile_index, lane, motion))
      s.move_slots(s.view, s.dt, first, end, found);
    else if (!deformed || !survey_lanes<T, Law::keeps_volume_positive>(s, motion, state, step_statistics))
      s.statistics_slots(s.view, s.dt, first, end, found);
  }
}

/// finish_tile() of the first law of a list with this model, inlined or as a function of its own, in which all is
/// inlined; false where there is none.
template <typename T, typename Law>
[[gnu::noinline, gnu::flatten]] void finish_tile_of_other(const CpuStep<T>& s, AdvanceParts parts,
                                                          const GatherTile<T>& work, const TileOwners<T>& owners,
                                                          int64_t tile_index, LaneStepStatistics<T>& step_statistics,
                                                          StepStatistics& found) {
  finish_tile<T, Law>(s, parts, work, owners, tile_index, step_statistics, found);
}
template <typename T, typename Law, bool frequent>
GRAUPEL_LANES bool try_law(MaterialModel model, const CpuStep<T>& s, AdvanceParts parts, const GatherTile<T>& work,
                           const TileOwners<T>& owners, int64_t tile_index, LaneStepStatistics<T>& step_statistics,
                           StepStatistics& found) {
  if constexpr (Law::measure == Measure::nothing) {
    return false;
  } else {
    if (model != Law::model) return false;
    if constexpr (frequent)
      finish_tile<T, Law>(s, parts, work, owners, tile_index, step_statistics, found);
    else
      finish_tile_of_other<T, Law>(s, parts, work, owners, tile_index, step_statistics, found);
    return true;
  }
}
template <typename T, bool frequent, typename... Laws>
GRAUPEL_LANES bool finish_tile_by(LawList<Laws...>, MaterialModel model, const CpuStep<T>& s, AdvanceParts parts,
                                  const GatherTile<T>& work, const TileOwners<T>& owners, int64_t tile_index,
                                  LaneStepStatistics<T>& step_statistics, StepStatistics& found) {
  return (try_law<T, Laws, frequent>(model, s, parts, work, owners, tile_index, step_statistics, found) || ...);
}

/// Any tile: mixed materials, particles at rest or not there.
template <typename T>
GRAUPEL_LANES void finish_any_tile(const CpuStep<T>& s, AdvanceParts parts, const GatherTile<T>& work,
                                   const TileOwners<T>& owners, int64_t tile_index, StepStatistics& found) {
  const int64_t first = tile_index * tile_lanes, end = first + owners.lanes;
  for (int lane = 0; lane < tile_lanes; lane += width<T>) {
    LaneMotion<T> motion;
    take_velocity(s, work, owners, tile_index, lane, motion);
  }
  if (parts != AdvanceParts::gather) s.deform_slots(s.view, s.dt, first, end);
  if (parts == AdvanceParts::all) s.move_slots(s.view, s.dt, first, end, found);
}

template <typename T>
[[gnu::flatten]] void advance(const CpuStep<T>& s, AdvanceParts parts, int64_t record, StepStatistics& found) {
  constexpr int64_t tiles = slots_per_record / tile;
  const int64_t end =
      (s.count + tile - 1) / tile < (record + 1) * tiles ? (s.count + tile - 1) / tile : (record + 1) * tiles;
  KnownOwner known;
  TileOwners<T> owners;
  GatherTile<T> work;
  LaneStepStatistics<T> step_statistics;
  for (int64_t t = record * tiles; t < end; ++t) {
    find_owners(s, t, known, owners);
    for (int lane = 0; lane < tile_lanes; lane += width<T>) {
      Ints<T> low[3];
      owners.low_of(lane, low);
      prepare_gather(s, t, lane, low, work);
    }
    for (int l = 0; l < tile_lanes; ++l) gather_one(work, l, owners.arena[l]);
    const MaterialModel model = s.materials[s.material[t * tile_lanes]].model;
    const bool simple = owners.uniform && parts != AdvanceParts::gather;
    if (!simple ||
        !(finish_tile_by<T, true>(FrequentLaws{}, model, s, parts, work, owners, t, step_statistics, found) ||
          finish_tile_by<T, false>(OtherLaws{}, model, s, parts, work, owners, t, step_statistics, found)))
      finish_any_tile(s, parts, work, owners, t, found);
  }
  step_statistics.add_to(found);
}

}  // namespace

namespace GRAUPEL_ISA {
extern const CpuKernels<float> kernels_f32;
extern const CpuKernels<double> kernels_f64;
const CpuKernels<float> kernels_f32 = {scatter<float>, sum_arenas<float>, update_nodes<float>, fill_arena<float>,
                                       advance<float>};
const CpuKernels<double> kernels_f64 = {scatter<double>, sum_arenas<double>, update_nodes<double>, fill_arena<double>,
                                        advance<double>};
}  // namespace GRAUPEL_ISA

}  // namespace graupel::mpm
