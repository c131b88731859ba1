#include <cstring>
#include <numeric>

#include "mpm/scene/scene_setup.h"
#include "rom/cuda/device_run.h"

namespace graupel::rom::device {

InstanceStore::InstanceStore(Device device, const ModelTable& model, InstanceTable table, int64_t steps_per_frame,
                             InstanceState* state)
    : device_(device),
      table_(std::move(table)),
      steps_(steps_per_frame),
      moving_(device, table_.prepared.scene, table_.prepared.obstacles),
      obstacle_nodes_(device, mpm::grid_of<float>(table_.prepared.scene.domain), moving_.fixed()) {
  const Scene& scene = table_.prepared.scene;
  view_.scene.grid = mpm::grid_of<float>(scene.domain);
  view_.scene.walls = mpm::wall_view<float>(scene);
  view_.scene.gravity = scene.gravity.cast<float>();
  view_.scene.push_out = scene.push_out;
  view_.scene.obstacle_nodes = obstacle_nodes_.view();
  view_.scene.materials = nullptr;  // only a deformation alone asks for the material of a point
  const int64_t blocks = view_.scene.grid.directory_size();
  set_particles(model);
  const auto moving = moving_.view();
  view_.step_count = static_cast<int32_t>(steps_);
  view_.moving_count = moving.count;
  view_.moving_index = moving.index;
  view_.obstacle_count = moving.count > 0 ? static_cast<int32_t>(scene.obstacles.size()) : 0;
  view_.script_count = static_cast<int32_t>(table_.prepared.particles.scripts.size());
  constexpr int64_t reach = 8;  // blocks that a sample marks
  const auto marked = static_cast<std::size_t>(std::min(blocks, reach * static_cast<int64_t>(model.samples.size())));
  view_.block_mark = make(block_mark_, static_cast<std::size_t>(blocks));
  view_.sums = make(sums_, marked * block_nodes * mpm::channels);
  view_.point_taken = make(point_taken_, model.point_particle.size());
  view_.map_rows = make(map_rows_, static_cast<std::size_t>(model.stress_map.outputs + model.affine_map.outputs));
  const std::size_t modes = table_.coefficient.size();
  view_.ahead = make(ahead_, modes);
  view_.slope = make(slope_, modes * static_cast<std::size_t>(model.latents));
  view_.gram = make(gram_, modes * modes);
  view_.equations = make(equations_, 1);
  view_.ways = make(ways_, 1);
  view_.lost = make(lost_, model.samples.size());
  view_.parameters = keep(parameters_, table_.parameters);
  keep(coefficient_, table_.coefficient);
  keep(rate_, table_.rate);
  view_.earlier = make(earlier_, modes);
  keep(reached_, table_.coefficient);
  view_.reached = reached_.data();
  view_.curve = keep(curve_, table_.curve);
  view_.curve_points = static_cast<int32_t>(table_.curve.size() / static_cast<std::size_t>(model.latents));
  view_.coefficient = coefficient_.data();
  if (model.deformation_alone()) set_elastic(model);
  view_.rate = rate_.data();
  view_.state = state;
}

void InstanceStore::set_particles(const ModelTable& model) {
  const mpm::SampledParticles& all = table_.prepared.particles;
  std::vector<float> density;
  std::vector<uint8_t> still;
  for (const std::string& name : all.material_names) {
    const MaterialConfig& config = table_.prepared.scene.materials.at(name);
    density.push_back(mpm::material_parameters<float>(config).density);
    still.push_back(config.model == MaterialModel::stationary ? 1 : 0);
  }
  std::vector<float> mass, volume;
  std::vector<uint8_t> sample_still;
  std::vector<int32_t> point_script, sample_script;
  const bool scripted = !all.scripts.empty();
  for (std::size_t i = 0; i < model.point_particle.size(); ++i) {
    const auto p = static_cast<std::size_t>(model.point_particle[i]);
    volume.push_back(static_cast<float>(all.volume[p] * table_.point_weight[i]));
    mass.push_back(density[static_cast<std::size_t>(all.material[p])] * volume.back());
    if (scripted) point_script.push_back(all.script[p]);
  }
  for (const int32_t sample : model.samples) {
    const auto p = static_cast<std::size_t>(sample);
    sample_still.push_back(still[static_cast<std::size_t>(all.material[p])]);
    if (scripted) sample_script.push_back(all.script[p]);
  }
  view_.point_mass = keep(point_mass_, mass);
  view_.point_volume = keep(point_volume_, volume);
  view_.sample_still = keep(sample_still_, sample_still);
  view_.point_script = scripted ? keep(point_script_, point_script) : nullptr;
  view_.sample_script = scripted ? keep(sample_script_, sample_script) : nullptr;
}

/// What a model of the deformation alone needs: laws, lists of groups of points, weights of samples.
void InstanceStore::set_elastic(const ModelTable& model) {
  const mpm::SampledParticles& all = table_.prepared.particles;
  std::vector<mpm::MaterialParameters<float>> materials;
  for (const std::string& name : all.material_names)
    materials.push_back(mpm::material_parameters<float>(table_.prepared.scene.materials.at(name)));
  view_.scene.materials = keep(materials_, materials);
  std::vector<int32_t> material;
  for (const int32_t p : model.point_particle) material.push_back(all.material[static_cast<std::size_t>(p)]);
  view_.point_material = keep(point_material_, material);
  const std::size_t groups = model.point_reference.size() / (3 * warp_width);
  view_.groups = make(groups_, groups);
  view_.group_points = make(group_points_, groups);
  view_.weight = make(weight_, model.samples.size());
  view_.weighed = make(weighed_, model.samples.size());
  view_.reached = coefficient_.data();  // they are moved in place
}

InstanceState InstanceStore::start() const {
  InstanceState state{};
  std::copy(table_.latent.begin(), table_.latent.end(), state.latent);
  std::copy(table_.velocity.begin(), table_.velocity.end(), state.velocity);
  state.due = state.round = 1;
  return state;
}

InstanceStore::FrameLayout InstanceStore::frame_layout() const {
  const auto obstacles = static_cast<std::size_t>(steps_ * view_.obstacle_count),
             scripts = static_cast<std::size_t>(steps_ * view_.script_count);
  const auto aligned = [](std::size_t bytes) { return (bytes + 63) / 64 * 64; };
  FrameLayout at;
  at.end = at.start + aligned(obstacles * sizeof(sparsegrid::ObstacleView));
  at.moves = at.end + aligned(obstacles * sizeof(sparsegrid::ObstacleView));
  at.scripts = at.moves + aligned(obstacles * sizeof(mpm::RigidStep<float>));
  at.bytes = at.scripts + aligned(scripts * sizeof(mpm::ScriptStep<float>));
  return at;
}

void InstanceStore::place_frame(std::byte* device) {
  const FrameLayout at = frame_layout();
  view_.moving_start = reinterpret_cast<const sparsegrid::ObstacleView*>(device + at.start);
  view_.moving_end = reinterpret_cast<const sparsegrid::ObstacleView*>(device + at.end);
  view_.moving_step = reinterpret_cast<const mpm::RigidStep<float>*>(device + at.moves);
  view_.scripts = reinterpret_cast<const mpm::ScriptStep<float>*>(device + at.scripts);
}

void InstanceStore::fill_frame(double time, double dt, std::byte* host) const {
  const Scene& scene = table_.prepared.scene;
  const auto put = [&](std::size_t& place, const auto& value) {
    std::memcpy(host + place, &value, sizeof value);
    place += sizeof value;
  };
  FrameLayout next = frame_layout();
  for (int64_t i = 0; i < steps_; ++i, time += dt) {
    for (const mpm::Script& script : table_.prepared.particles.scripts)
      put(next.scripts, mpm::ScriptStep<float>{mpm::rigid_step<float>(script.motion, script.body_center, time, dt),
                                               time < script.release_time});
    if (view_.moving_count == 0) continue;
    for (const auto& pose : table_.prepared.obstacles.views_at(time, device_)) put(next.start, pose);
    for (const auto& pose : table_.prepared.obstacles.views_at(time + dt, device_)) put(next.end, pose);
    for (const Obstacle& obstacle : scene.obstacles)
      put(next.moves, obstacle.motion ? mpm::rigid_step<float>(*obstacle.motion, obstacle.position, time, dt)
                                      : mpm::RigidStep<float>{Mat3f::zero(), Vec3f::zero(), Vec3f::zero()});
  }
}

}  // namespace graupel::rom::device
