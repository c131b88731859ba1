#include "mpm/solver/scene_grid.h"

#include "mpm/cpu/tuned_phases.h"
#include "mpm/phases/transfer_form.h"

namespace graupel::mpm {

template <typename T>
SceneGrid<T>::SceneGrid(const SimulationOptions& options, const Scene& scene, const SampledParticles& sampled,
                        const sparsegrid::ObstacleSet& obstacles, int64_t particles)
    : device(options.device),
      tuned(device == Device::cpu && options.kernels == Kernels::tuned && !scene.domain.is_plane() &&
            scene.transfer.spline == Spline::quadratic),
      instruction_set(options.instruction_set.value_or(graupel::instruction_set())),
      geometry(grid_of<T>(scene.domain)),
      walls(wall_view<T>(scene)),
      gravity(scene.gravity.template cast<T>()),
      push_out(scene.push_out),
      periodic(scene.domain.has_wall(Wall::periodic)),
      dimensions(scene.domain.axes()),
      spline(scene.transfer.spline),
      materials(device, 0),
      moving(device, scene, obstacles),
      lifecycle(device, scene, sampled),
      obstacle_nodes(device, geometry, moving.fixed(), dimensions),
      records(device, 0),
      first_gravity_(scene.gravity),
      gravity_keyframes_(scene.gravity_keyframes),
      arenas_(device, 0),
      nodes_(device, 0),
      joined_(device, 0),
      impulses_(device, 0) {
  std::vector<MaterialParameters<T>> parameters;
  for (const std::string& name : sampled.material_names) {
    material_configs.push_back(scene.materials.at(name));
    parameters.push_back(material_parameters<T>(material_configs.back()));
    some_stationary = some_stationary || material_configs.back().model == MaterialModel::stationary;
  }
  materials.upload(parameters);
  resize(particles);
}

template <typename T>
void SceneGrid<T>::resize(int64_t particles) {
  blocks = BlockTable(device, geometry.blocks, dimensions, particles);
  if (periodic) blocks.keep_node_lookup();
}

template <typename T>
SolverView<T> SceneGrid<T>::view(const ParticleView<T>& particles) {
  SolverView<T> v;
  v.grid = geometry;
  v.walls = walls;
  v.gravity = gravity;
  v.push_out = push_out;
  v.obstacle_nodes = obstacle_nodes.view();
  v.materials = materials.data();
  v.device = device;
  v.particles = particles;
  v.blocks = blocks.view();
  v.moving = moving.view();
  v.lifecycle = lifecycle.view();
  v.dimensions = dimensions;
  v.spline = spline;
  v.arenas = arenas_.data();
  v.nodes = nodes_.data();
  v.keys = blocks.keys();
  v.keys_changed = blocks.changed_flag();
  v.some_stationary = some_stationary;
  return v;
}

template <typename T>
void SceneGrid<T>::sort(const ParticleView<T>& particles) {
  blocks.update();
  // With room for more: while material spreads there are more blocks in every
  // substep.
  const auto reserve = [](Buffer<T>& buffer, std::size_t n) {
    if (n > buffer.size()) buffer.resize_discard(n + n / 4);
  };
  with_form(view(particles), [&](auto form) {
    constexpr int D = decltype(form)::D;
    const BlockView b = blocks.view();
    if (device == Device::cpu)
      reserve(arenas_, static_cast<std::size_t>(b.owner_count) * arena_size<D, decltype(form)::spline>);
    reserve(nodes_, static_cast<std::size_t>(b.node_count) * nodes_per_block<D> * channels);
  });
}

template <typename T>
void SceneGrid<T>::lead(const SolverView<T>& v, Vec3d& scripted) {
  if (lifecycle.has_scripts()) scripted += move_kinematic_particles(v, impulses_);
}

template <typename T>
SolverView<T> SceneGrid<T>::move_nodes(const ParticleView<T>& particles, double time, double dt, Vec3d& scripted) {
  const T step = static_cast<T>(dt);
  sort(particles);
  if (moving.any()) moving.begin_step(time, dt);
  if (!gravity_keyframes_.empty())
    gravity = mean_gravity(first_gravity_, gravity_keyframes_, time, dt).template cast<T>();
  lifecycle.begin_step(time, dt);
  SolverView<T> v = view(particles);
  lead(v, scripted);
  if (tuned)
    particle_to_grid_tuned(v, step, instruction_set,
                           periodic || contacts != nullptr ? GridParts::sums : GridParts::velocities);
  else
    particle_to_grid(v, step);
  if (periodic) {
    joined_.resize_discard(nodes_.size());
    join_periodic(v, joined_.data());
    std::swap(nodes_, joined_);
    v = view(particles);
  }
  if (contacts != nullptr) contacts->add_nodes(v, time, dt);
  if (periodic || !tuned)
    update_grid(v, step);
  else if (contacts != nullptr)
    update_grid_tuned(v, step, instruction_set);
  return v;
}

template <typename T>
int64_t SceneGrid<T>::bytes() const {
  return blocks.bytes() + obstacle_nodes.bytes() +
         static_cast<int64_t>((arenas_.size() + nodes_.size() + joined_.size()) * sizeof(T));
}

template struct SceneGrid<float>;
template struct SceneGrid<double>;

}  // namespace graupel::mpm
