#include "rom/solver/particle_grid.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/system/error.h"
#include "mpm/cpu/tuned_phases.h"
#include "mpm/materials/material.h"
#include "mpm/phases/transfer_form.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::rom {

template <typename T>
ParticleGrid<T>::ParticleGrid(const mpm::PreparedScene& prepared)
    : prepared_(prepared),
      grid_(mpm::grid_of<T>(prepared.scene.domain)),
      walls_(mpm::wall_view<T>(prepared.scene)),
      materials_(Device::cpu, 0),
      moving_(Device::cpu, prepared.scene, prepared.obstacles),
      roles_(Device::cpu, prepared.scene, prepared.particles),
      obstacle_nodes_(Device::cpu, grid_, moving_.fixed(), prepared.scene.domain.axes()),
      arenas_(Device::cpu, 0),
      nodes_(Device::cpu, 0),
      joined_(Device::cpu, 0),
      records_(Device::cpu, 0),
      impulses_(Device::cpu, 0),
      instruction_set_(instruction_set()) {
  if (prepared.scene.has_inactive_particles())
    throw ConfigError(
        "reduced-order models need particles that are in the run all the time (the scene has emitters, sinks or open "
        "walls). Remove them from the scene");
  std::vector<mpm::MaterialParameters<T>> parameters;
  for (const std::string& name : prepared.particles.material_names) {
    configs_.push_back(prepared.scene.materials.at(name));
    parameters.push_back(mpm::material_parameters<T>(configs_.back()));
    some_stationary_ = some_stationary_ || configs_.back().model == MaterialModel::stationary;
  }
  materials_.upload(parameters);
}

template <typename T>
void ParticleGrid<T>::choose(const GridParticles& chosen) {
  const auto n = static_cast<int64_t>(chosen.particles.size());
  const mpm::SampledParticles& all = prepared_.particles;
  chosen_ = mpm::Particles<T>(Device::cpu, n);
  samples_ = chosen.samples;
  const mpm::ParticleView<T> p = chosen_.view();
  for (int64_t slot = 0; slot < n; ++slot) {
    const auto particle = static_cast<std::size_t>(chosen.particles[static_cast<std::size_t>(slot)]);
    const int32_t material = all.material[particle];
    const MaterialModel model = configs_[static_cast<std::size_t>(material)].model;
    mpm::store_matrix<T, 3>(p.deformation_gradient, slot, Mat<T, 3>::identity());
    p.internal.set(slot, static_cast<T>(mpm::initial_internal_variable(model)));
    p.volume.set(slot, static_cast<T>(all.volume[particle] * chosen.share[static_cast<std::size_t>(slot)]));
    p.material.set(slot, material);
    p.source_index.set(slot, static_cast<int32_t>(particle));
  }
  blocks_ = mpm::BlockTable(Device::cpu, grid_.blocks, prepared_.scene.domain.axes(), n);
  if (prepared_.scene.domain.has_wall(Wall::periodic)) blocks_.keep_node_lookup();
  particles_ = mpm::Particles<T>(Device::cpu, n);
  std::vector<int32_t> tiles(static_cast<std::size_t>(mpm::padded_to_tile(n) / mpm::tile));
  std::iota(tiles.begin(), tiles.end(), 0);
  select(tiles);
}

template <typename T>
void ParticleGrid<T>::select(const std::vector<int32_t>& tiles) {
  const mpm::ParticleView<T> all = chosen_.view(), to = particles_.view();
  const auto copy = [](const auto& from, const auto& into, int64_t source, int64_t target) {
    const int64_t numbers = from.at(mpm::tile) - from.at(0);
    std::copy_n(from.at(source * mpm::tile), numbers, into.at(target * mpm::tile));
  };
  for (std::size_t j = 0; j < tiles.size(); ++j) {
    const auto target = static_cast<int64_t>(j);
    copy(all.deformation_gradient, to.deformation_gradient, tiles[j], target);
    copy(all.internal, to.internal, tiles[j], target);
    copy(all.volume, to.volume, tiles[j], target);
    copy(all.material, to.material, tiles[j], target);
    copy(all.source_index, to.source_index, tiles[j], target);
  }
  const auto tile_count = static_cast<int64_t>(tiles.size());
  const int64_t missing = tiles.empty() ? 0 : std::max<int64_t>(0, (tiles.back() + 1) * mpm::tile - all.count);
  count_ = tile_count * mpm::tile - missing;
  std::fill_n(blocks_.keys() + count_, all.count - count_, -1);  // without a block: they take no part
}

template <typename T>
mpm::ParticleView<T> ParticleGrid<T>::particles() {
  mpm::ParticleView<T> view = particles_.view();
  view.count = count_;
  return view;
}

template <typename T>
mpm::SolverView<T> ParticleGrid<T>::view() {
  mpm::SolverView<T> v;
  v.grid = grid_;
  v.walls = walls_;
  v.gravity = prepared_.scene.gravity.template cast<T>();
  v.push_out = prepared_.scene.push_out;
  v.obstacle_nodes = obstacle_nodes_.view();
  v.materials = materials_.data();
  v.device = Device::cpu;
  v.particles = particles();
  v.blocks = blocks_.view();
  v.moving = moving_.view();
  v.roles = roles_.view();
  v.dimensions = prepared_.scene.domain.axes();
  v.spline = prepared_.scene.transfer.spline;
  v.arenas = arenas_.data();
  v.nodes = nodes_.data();
  v.keys = blocks_.keys();
  v.keys_changed = blocks_.changed_flag();
  v.some_stationary = some_stationary_;
  return v;
}

template <typename T>
void ParticleGrid<T>::make_room() {
  mpm::with_form(view(), [&](auto form) {
    constexpr int D = decltype(form)::D;
    const mpm::BlockView b = blocks_.view();
    const auto grow = [](Buffer<T>& buffer, std::size_t n) {
      if (n > buffer.size()) buffer.resize_discard(n + n / 4);
    };
    grow(arenas_, static_cast<std::size_t>(b.home_count) * mpm::arena_size<D, decltype(form)::spline>);
    grow(nodes_, static_cast<std::size_t>(b.node_count) * mpm::nodes_per_block<D> * mpm::channels);
  });
}

template <typename T>
void ParticleGrid<T>::step(double time, double dt, std::vector<bool>& lost) {
  const T step = static_cast<T>(dt);
  const Scene& scene = prepared_.scene;
  const bool tuned = !scene.domain.is_plane() && scene.transfer.spline == Spline::quadratic;
  const bool periodic = scene.domain.has_wall(Wall::periodic);
  mpm::find_home_blocks(view());
  blocks_.invalidate();
  blocks_.update();
  make_room();
  if (moving_.any()) moving_.begin_step(time, dt);
  roles_.begin_step(time, dt);
  mpm::SolverView<T> v = view();
  if (roles_.has_scripts()) mpm::lead_particles(v, impulses_);
  if (tuned)
    mpm::particle_to_grid_tuned(v, step, instruction_set_,
                                periodic ? mpm::GridParts::sums : mpm::GridParts::velocities);
  else
    mpm::particle_to_grid(v, step);
  if (periodic) {
    joined_.resize_discard(nodes_.size());
    mpm::join_periodic(v, joined_.data());
    std::swap(nodes_, joined_);
    v = view();
  }
  if (periodic || !tuned) mpm::update_grid(v, step);
  mpm::grid_to_particle_slots(v, samples_);
  if (roles_.has_scripts()) mpm::lead_particles(v, impulses_);
  move_samples(v, step, lost);
}

template <typename T>
void ParticleGrid<T>::move_samples(const mpm::SolverView<T>& v, T dt, std::vector<bool>& lost) {
  lost.assign(static_cast<std::size_t>(samples_), false);
  for (int64_t s = 0; s < samples_; ++s) {
    if (mpm::within_a_cell(dt * v.particles.velocity.vec(s), grid_.dx)) continue;
    lost[static_cast<std::size_t>(s)] = true;
    v.particles.velocity.set_vec(s, Vec<T, 3>::zero());
  }
  mpm::SolverView<T> samples = v;
  samples.particles.count = samples_;
  mpm::move_particles(samples, dt, records_);
}

template <typename T>
int64_t ParticleGrid<T>::active_nodes() const {
  const bool plane = prepared_.scene.domain.is_plane();
  return int64_t(blocks_.view().node_count) * (plane ? mpm::nodes_per_block<2> : mpm::nodes_per_block<3>);
}

template <typename T>
int64_t ParticleGrid<T>::bytes() const {
  return particles_.bytes() + chosen_.bytes() + blocks_.bytes() + obstacle_nodes_.bytes() +
         static_cast<int64_t>((arenas_.size() + nodes_.size() + joined_.size()) * sizeof(T));
}

template class ParticleGrid<float>;
template class ParticleGrid<double>;

}  // namespace graupel::rom
