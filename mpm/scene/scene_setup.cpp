#include "mpm/scene/scene_setup.h"

#include <algorithm>

#include "mpm/materials/list.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm {

template <typename T>
SceneSetup<T>::SceneSetup(Scene read_scene, const SampledParticles& particles, const sparsegrid::ObstacleSet& set,
                          Device device)
    : scene(std::move(read_scene)),
      obstacles(set),
      grid(grid_of<T>(scene.domain)),
      walls(wall_view<T>(scene)),
      materials(device, 0),
      moving(device, scene, obstacles),
      lifecycle(device, scene, particles),
      obstacle_nodes(device, grid, moving.fixed()) {
  std::vector<MaterialParameters<T>> parameters;
  for (const std::string& name : particles.material_names) {
    material_configs.push_back(scene.materials.at(name));
    parameters.push_back(material_parameters<T>(material_configs.back()));
  }
  for (const MaterialConfig& m : material_configs)
    if (is_fluid(m.model)) diffusivity = std::max(diffusivity, m.viscosity / m.density);
  materials.upload(parameters);
  for (const double volume : particles.volume) largest_volume = std::max(largest_volume, volume);
  for (const int32_t m : particles.material)
    particle_type.push_back(particle_type_of(material_configs[static_cast<std::size_t>(m)].model));
}

template <typename T>
SceneView<T> SceneSetup<T>::view() const {
  return {grid, walls, scene.gravity.template cast<T>(), scene.push_out, obstacle_nodes.view(), materials.data()};
}

template <typename T>
double SceneSetup<T>::fastest(double speed, double from) const {
  const double to = from + scene.frame_time;
  return std::max(speed, lifecycle.largest_speed(from, to)) + moving.largest_speed(from, to) +
         norm(scene.gravity) * scene.frame_time;
}

StepStatistics survey_start(const SceneSetup<float>& setup, const HostParticles<float>& particles) {
  std::vector<MaterialParameters<float>> parameters;
  for (const MaterialConfig& config : setup.material_configs) parameters.push_back(material_parameters<float>(config));
  const std::vector<uint8_t> active = setup.lifecycle.active();
  StepStatistics found;
  for (std::size_t i = 0; i < particles.size(); ++i)
    if (active.empty() || active[i] != 0)
      state_statistics(setup.grid.dx, parameters[static_cast<std::size_t>(particles.material[i])],
                       static_cast<int64_t>(i), particles.velocity[i], particles.deformation_gradient[i],
                       particles.internal[i], 0.0f, found);
  return found;
}

void append(HostParticles<float>& all, const HostParticles<float>& more) {
  const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  add(all.position, more.position);
  add(all.velocity, more.velocity);
  add(all.affine_velocity, more.affine_velocity);
  add(all.deformation_gradient, more.deformation_gradient);
  add(all.stress, more.stress);
  add(all.internal, more.internal);
  add(all.volume, more.volume);
  add(all.material, more.material);
  add(all.source_index, more.source_index);
}

template struct SceneSetup<float>;

}  // namespace graupel::mpm
