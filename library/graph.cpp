#include "library/graph.h"

#include <fmt/format.h>

#include <cmath>

#include "core/scene/materials_by_type.h"
#include "experiments/models/start_state.h"
#include "experiments/models/trained_materials.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"

namespace graupel {

namespace {

/// Throws ConfigError unless there are history + 1 frames of all particles, at least one, at finite places.
void check_history(const NetworkHistory& history, int64_t velocities) {
  const auto frames = static_cast<std::size_t>(velocities) + 1;
  const std::size_t particles = history.particle_type.size();
  if (history.position.size() != frames || particles == 0)
    throw ConfigError(
        fmt::format("the history has {} frames of {} particles (allowed: {} frames, at least 1 particle). "
                    "Give the newest {} positions, newest last",
                    history.position.size(), particles, frames, frames));
  for (std::size_t f = 0; f < frames; ++f) {
    if (history.position[f].size() != particles)
      throw ConfigError(
          fmt::format("frame {} of the history has {} particles (allowed: {}, as there are types). Give all", f,
                      history.position[f].size(), particles));
    for (std::size_t i = 0; i < particles; ++i)
      for (int d = 0; d < 3; ++d)
        if (!std::isfinite(history.position[f][i][d]))
          throw ConfigError(
              fmt::format("particle {} of frame {} of the history is at {} (allowed: finite numbers). "
                          "Correct it",
                          i, f, history.position[f][i][d]));
  }
}

}  // namespace

struct NetworkModel::Impl {
  std::string file;
  graph::LearnedSimulator simulator;
};

NetworkModel::NetworkModel(const std::string& weights_file)
    : impl_(std::make_unique<Impl>(Impl{weights_file, graph::LearnedSimulator(weights_file)})) {}
NetworkModel::NetworkModel(NetworkModel&&) noexcept = default;
NetworkModel& NetworkModel::operator=(NetworkModel&&) noexcept = default;
NetworkModel::~NetworkModel() = default;

Trajectory NetworkModel::rollout(const Scene& scene, const NetworkRollout& options) const {
  if (options.device == Device::cuda) parse_device("cuda");  // says what is missing
  const uint64_t seed = options.seed.value_or(scene.seed);
  const experiments::StartState start = experiments::start_of(scene, seed);
  const int history = static_cast<int>(impl_->simulator.config().history) + 1;
  const graph::ParticleSchedule schedule = experiments::schedule_of(start);
  graph::LearnedSimulator::RolloutOptions run;
  run.frames = options.frames.value_or(scene.frames);
  run.device = options.device;
  run.project = options.keep_out;
  run.density_limit = scene.domain.is_plane() ? 0 : options.density_limit;
  run.free_flight = options.free_flight;
  run.schedule = &schedule;
  if (impl_->simulator.config().material_constants) run.material = start.material;
  if (options.progress) run.progress = [&](int64_t frame, const graph::FrameTiming&) { options.progress(frame); };
  Trajectory trajectory = impl_->simulator.rollout(scene, graph::Environment(scene), start.particle_type,
                                                   experiments::past_of(start, scene, history), run);
  trajectory.materials = kept_materials(scene.materials, start.material);
  trajectory.scene_json = io::scene_to_json(scene);
  trajectory.seed = seed;
  trajectory.made_by = impl_->file;
  return trajectory;
}

NetworkHistory NetworkModel::start(const Scene& scene, std::optional<uint64_t> seed) const {
  const experiments::StartState start = experiments::start_of(scene, seed.value_or(scene.seed));
  const int frames = static_cast<int>(impl_->simulator.config().history) + 1;
  return {start.particle_type, experiments::past_of(start, scene, frames)};
}

NetworkInput NetworkModel::input(const Scene& scene, const NetworkHistory& history) const {
  const graph::FeatureConfig& config = impl_->simulator.config();
  check_history(history, config.history);
  const graph::Environment environment(scene);
  const std::vector<int32_t> material =
      config.material_constants ? environment.materials.by_type(history.particle_type) : std::vector<int32_t>{};
  const std::shared_ptr<const graph::Network> network = graph::load_network(impl_->simulator.weights());
  NetworkInput input;
  input.features = graph::particle_features(config, network->normalization(), environment, history.position, material);
  input.width = input.features.size() / history.particle_type.size();
  for (const int32_t type : history.particle_type) input.embedding_row.push_back(graph::embedding_row(type));
  input.grid_origin = environment.grid_origin(network->spacing());
  return input;
}

std::vector<Vec3f> NetworkModel::accelerations(const Scene& scene, const NetworkHistory& history) const {
  check_history(history, impl_->simulator.config().history);
  return impl_->simulator.one_step(graph::Environment(scene), history.particle_type, history.position);
}

std::vector<std::string> NetworkModel::remarks(const Scene& scene) const {
  return experiments::training_remarks(impl_->simulator.weights(), scene);
}

}  // namespace graupel
