#include "mpm/phases/user_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "mpm/phases/update_particle.h"

namespace graupel::mpm {

namespace {

constexpr int64_t slots_per_task = 64 * tile;

template <typename T>
const UserMaterial* law_at(const SolverView<T>& view, const UserLaws& laws, int64_t slot) {
  return laws[static_cast<std::size_t>(view.particles.material.get(slot))].get();
}

template <typename T>
MaterialState state_at(const ParticleView<T>& p, int64_t slot) {
  return {load_matrix<T, 3>(p.deformation_gradient, slot).template cast<double>(),
          static_cast<double>(p.internal.get(slot))};
}

/// One step of a particle with a user's law: trial deformation, return mapping and stress.
template <typename T>
void follow_law(const UserMaterial& law, const ParticleView<T>& p, int64_t slot, double dt) {
  const MaterialStep step{dt, load_matrix<T, 3>(p.affine_velocity, slot).template cast<double>()};
  MaterialState state = state_at(p, slot);
  state.F = (Mat3d::identity() + dt * step.velocity_gradient) * state.F;
  const Mat3d tau = law.stress(step, state);
  store_symmetric(p.stress, slot, tau.cast<T>());
  store_matrix<T, 3>(p.deformation_gradient, slot, state.F.cast<T>());
  p.internal.set(slot, static_cast<T>(state.internal));
}

/// The particles of a tile, first..end - 1: all at once where none has a user's law.
template <typename T>
void update_tile(const SolverView<T>& view, T dt, const UserLaws& laws, int64_t first, int64_t end) {
  const ParticleView<T>& p = view.particles;
  bool any_law = false;
  for (int64_t slot = first; slot < end; ++slot) any_law = any_law || law_at(view, laws, slot) != nullptr;
  if (!any_law) return update_deformation_slots(view, dt, first, end);
  for (int64_t slot = first; slot < end; ++slot) {
    if (const UserMaterial* law = law_at(view, laws, slot)) {
      follow_law(*law, p, slot, static_cast<double>(dt));
      continue;
    }
    update_particle(view, dt, slot);
  }
}

/// task(i, first slot, end) for pieces of all slots, in parallel; the first error is thrown.
template <typename Task>
void for_slots(int64_t slots, const Task& task) {
  const int64_t tasks = (slots + slots_per_task - 1) / slots_per_task;
  TaskErrors errors(static_cast<std::size_t>(tasks));
  parallel_for_cpu(
      tasks,
      [&](int64_t i) {
        errors.run(static_cast<std::size_t>(i),
                   [&](std::size_t) { task(i, i * slots_per_task, std::min(slots, (i + 1) * slots_per_task)); });
      },
      Grain{1});
  errors.rethrow();
}

}  // namespace

MaterialConfig carrier_of(const MaterialConfig& material) {
  MaterialConfig carrier = material;
  carrier.model = MaterialModel::metal;
  carrier.youngs_modulus = carrier.yield_stress = carrier.hardening_modulus = 0;
  carrier.poissons_ratio = 0.25;
  return carrier;
}

Scene with_carriers(Scene scene, const UserMaterials& laws) {
  for (const auto& [name, law] : laws) {
    const auto found = scene.materials.find(name);
    if (found != scene.materials.end()) found->second = carrier_of(found->second);
  }
  return scene;
}

UserLaws laws_of(const std::vector<std::string>& names, const UserMaterials& laws) {
  UserLaws ordered(names.size());
  for (const auto& [name, law] : laws) {
    const auto place = std::find(names.begin(), names.end(), name);
    if (place == names.end())
      throw ConfigError(
          fmt::format("there is a user's law for the material '{}', which the scene does not have "
                      "(allowed: {}). Change the name",
                      name, fmt::join(names, ", ")));
    if (law == nullptr)
      throw ConfigError(fmt::format("the user's law for the material '{}' is a null pointer. Give an object", name));
    const double c = law->sound_speed({Mat3d::identity(), law->initial_internal()});
    if (!(c > 0 && std::isfinite(c)))
      throw ConfigError(
          fmt::format("the user's law for the material '{}' has a sound speed of {} m/s at rest (allowed: "
                      "above 0). Return sqrt((lambda + 2 mu) / density)",
                      name, c));
    ordered[static_cast<std::size_t>(place - names.begin())] = law;
  }
  if (laws.empty()) ordered.clear();
  return ordered;
}

template <typename T>
void update_deformation(const SolverView<T>& view, T dt, const UserLaws& laws) {
  for_slots(view.particles.count, [&](int64_t, int64_t first, int64_t end) {
    for (int64_t slot = first; slot < end; slot += tile) update_tile(view, dt, laws, slot, std::min(end, slot + tile));
  });
}

template <typename T>
void add_user_statistics(const SolverView<T>& view, T dt, const UserLaws& laws, StepStatistics& found) {
  std::vector<StepStatistics> records(static_cast<std::size_t>(view.particles.count / slots_per_task + 1));
  for_slots(view.particles.count, [&](int64_t i, int64_t first, int64_t end) {
    StepStatistics& record = records[static_cast<std::size_t>(i)];
    for (int64_t slot = first; slot < end; ++slot) {
      const UserMaterial* law = law_at(view, laws, slot);
      if (law == nullptr || view.keys[slot] == no_owner) continue;
      const double c = law->sound_speed(state_at(view.particles, slot));
      record.largest_sound_speed = std::max(record.largest_sound_speed, c);
      if (c * static_cast<double>(dt) > static_cast<double>(view.grid.dx)) ++record.over_courant;
    }
  });
  for (const StepStatistics& record : records) found.merge(record);
}

template <typename T>
double user_energy(const HostParticles<T>& particles, const UserLaws& laws, const std::vector<uint8_t>& active) {
  double energy = 0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const auto& law = laws[static_cast<std::size_t>(particles.material[i])];
    if (law == nullptr || !(active.empty() || active[static_cast<std::size_t>(particles.source_index[i])] != 0))
      continue;
    energy += static_cast<double>(particles.volume[i]) *
              law->energy({particles.deformation_gradient[i].template cast<double>(),
                           static_cast<double>(particles.internal[i])});
  }
  return energy;
}

#define GRAUPEL_INSTANTIATE(T)                                                                     \
  template void update_deformation<T>(const SolverView<T>&, T, const UserLaws&);                   \
  template void add_user_statistics<T>(const SolverView<T>&, T, const UserLaws&, StepStatistics&); \
  template double user_energy<T>(const HostParticles<T>&, const UserLaws&, const std::vector<uint8_t>&);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
