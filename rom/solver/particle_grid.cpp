#include "rom/solver/particle_grid.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/system/error.h"
#include "mpm/bspline.h"
#include "mpm/cpu/tuned_phases.h"
#include "mpm/materials/material.h"
#include "mpm/phases/transfer_scheme.h"
#include "mpm/physics/particle_motion.h"
#include "mpm/physics/stencil.h"

namespace graupel::rom {

template <typename T>
ParticleGrid<T>::ParticleGrid(const mpm::PreparedScene& prepared)
    : prepared_(prepared), grid_({}, prepared.scene, prepared.particles, prepared.obstacles, 0) {
  if (prepared.scene.has_inactive_particles())
    throw ConfigError(
        "reduced-order models need particles that are in the run "
        "all the time (the scene has emitters, sinks or open "
        "walls). Remove them from the scene");
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
    const MaterialModel model = grid_.material_configs[static_cast<std::size_t>(material)].model;
    mpm::store_matrix<T, 3>(p.deformation_gradient, slot, Mat<T, 3>::identity());
    p.internal.set(slot, static_cast<T>(mpm::initial_internal_variable(model)));
    p.volume.set(slot, static_cast<T>(all.volume[particle] * chosen.weight[static_cast<std::size_t>(slot)]));
    p.material.set(slot, material);
    p.source_index.set(slot, static_cast<int32_t>(particle));
  }
  grid_.resize(n);
  particles_ = mpm::Particles<T>(Device::cpu, n);
  std::fill_n(particles_.view().affine_velocity.data, 9 * mpm::padded_to_tile(n), T(0));
  std::fill_n(particles_.view().stress.data, 6 * mpm::padded_to_tile(n), T(0));
  std::vector<int32_t> tiles(static_cast<std::size_t>(mpm::padded_to_tile(n) / mpm::tile));
  std::iota(tiles.begin(), tiles.end(), 0);
  select(tiles);
}

/// What does not change of these tiles.
template <typename T>
void ParticleGrid<T>::copy_chosen(const std::vector<int32_t>& tiles) {
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
}

template <typename T>
void ParticleGrid<T>::select(const std::vector<int32_t>& tiles) {
  copy_chosen(tiles);
  const auto tile_count = static_cast<int64_t>(tiles.size());
  const int64_t missing = tiles.empty() ? 0 : std::max<int64_t>(0, (tiles.back() + 1) * mpm::tile - chosen_.count());
  count_ = tile_count * mpm::tile - missing;
  std::fill_n(grid_.blocks.keys() + count_, chosen_.count() - count_,
              -1);  // without a block: they take no part
}

template <typename T>
void ParticleGrid<T>::resize_points(int64_t count) {
  count_ = samples_ + count;
  if (count_ > particles_.count()) {
    const int64_t room = count_ + count_ / 4;
    particles_ = mpm::Particles<T>(Device::cpu, room);
    grid_.resize(room);
    std::vector<int32_t> tiles(static_cast<std::size_t>(mpm::padded_to_tile(samples_) / mpm::tile));
    std::iota(tiles.begin(), tiles.end(), 0);
    copy_chosen(tiles);
  }
  std::fill_n(grid_.blocks.keys() + count_, particles_.count() - count_, -1);
}

template <typename T>
mpm::ParticleView<T> ParticleGrid<T>::particles() {
  mpm::ParticleView<T> view = particles_.view();
  view.count = count_;
  return view;
}

template <typename T>
void ParticleGrid<T>::take_stress_of_deformation() {
  const mpm::ParticleView<T> p = particles();
  const mpm::MaterialParameters<T>* materials = grid_.materials.data();
  const auto body = [=](int64_t slot) {
    Mat<T, 3> F = mpm::load_matrix<T, 3>(p.deformation_gradient, slot);
    T internal = p.internal.get(slot);
    mpm::store_symmetric(p.stress, slot,
                         mpm::map_and_stress_of_solid(materials[p.material.get(slot)], T(0), F, internal));
  };
  parallel_for_cpu(p.count, body);
}

template <typename T>
void ParticleGrid<T>::step(double time, double dt, GradientKind gradient, double contact_weight,
                           std::vector<double>& weight) {
  mpm::find_owner_blocks(grid_.view(particles()));
  grid_.blocks.invalidate();
  Vec3d scripted = Vec3d::zero();
  const mpm::SolverView<T> v = grid_.move_nodes(particles(), time, dt, scripted);
  if (gradient == GradientKind::integrated) {
    gather_and_deform(v, static_cast<T>(dt), scripted);
  } else {
    mpm::grid_to_particle_slots(v, samples_);
    grid_.lead(v, scripted);
  }
  weight.assign(static_cast<std::size_t>(samples_), 1);
  if (contact_weight > 1 && v.moving.count > 0) weigh_contact(v, contact_weight, weight);
  move_samples(v, static_cast<T>(dt), weight);
}

/// G2P, scripts, deformation and return mapping of all points, as Solver::advance_particles has them.
template <typename T>
void ParticleGrid<T>::gather_and_deform(const mpm::SolverView<T>& v, T dt, Vec3d& scripted) {
  const bool deform_apart = grid_.lifecycle.has_scripts() || !grid_.tuned;  // scripts come between
  if (grid_.tuned)
    mpm::advance_tuned(v, dt, deform_apart ? mpm::AdvanceParts::gather : mpm::AdvanceParts::gather_and_deform,
                       grid_.records, grid_.instruction_set);
  else
    mpm::grid_to_particle(v);
  grid_.lead(v, scripted);
  if (deform_apart) mpm::update_deformation(v, dt);
  mpm::apply_transfer_scheme(v, prepared_.scene.transfer, static_cast<double>(dt));
}

template <typename T>
void ParticleGrid<T>::weigh_contact(const mpm::SolverView<T>& v, double contact_weight,
                                    std::vector<double>& weight) const {
  const auto one = [&](int64_t s) {
    const Vec<T, 3> x = v.particles.position.vec(s), local = v.grid.local(x);
    const auto stencil = mpm::stencil_at<Spline::quadratic>(local);
    mpm::AxisWeights<T> axis[3];
    for (int d = 0; d < 3; ++d) axis[d] = mpm::bspline_weights(stencil.fx[d]);
    T held = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k) {
          const Vec<T, 3> node = x + v.grid.dx * (Vec<T, 3>{T(i), T(j), T(k)} - stencil.fx);
          if (mpm::node_pushes(v.moving, node, v.grid.dx, v.particles.velocity.vec(s)))
            held += axis[0].w[i] * axis[1].w[j] * axis[2].w[k];
        }
    weight[static_cast<std::size_t>(s)] = 1 + (contact_weight - 1) * static_cast<double>(held);
  };
  parallel_for_cpu(samples_, one);
}

template <typename T>
void ParticleGrid<T>::move_samples(const mpm::SolverView<T>& v, T dt, std::vector<double>& weight) {
  for (int64_t s = 0; s < samples_; ++s) {
    if (mpm::within_a_cell(dt * v.particles.velocity.vec(s), grid_.geometry.dx)) continue;
    weight[static_cast<std::size_t>(s)] = 0;
    v.particles.velocity.set_vec(s, Vec<T, 3>::zero());
  }
  mpm::SolverView<T> samples = v;
  samples.particles.count = samples_;
  mpm::move_particles(samples, dt, grid_.records);
}

template <typename T>
int64_t ParticleGrid<T>::active_nodes() const {
  const bool plane = prepared_.scene.domain.is_plane();
  return int64_t(grid_.blocks.view().node_count) * (plane ? mpm::nodes_per_block<2> : mpm::nodes_per_block<3>);
}

template <typename T>
int64_t ParticleGrid<T>::bytes() const {
  return particles_.bytes() + chosen_.bytes() + grid_.bytes();
}

template class ParticleGrid<float>;
template class ParticleGrid<double>;

}  // namespace graupel::rom
