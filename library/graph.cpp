#include "library/graph.h"

#include "experiments/models/start_state.h"
#include "experiments/models/trained_materials.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"

namespace graupel {

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
  trajectory.scene_json = io::scene_to_json(scene);
  trajectory.seed = seed;
  trajectory.made_by = impl_->file;
  return trajectory;
}

std::vector<std::string> NetworkModel::remarks(const Scene& scene) const {
  return experiments::training_remarks(impl_->simulator.weights(), scene);
}

}  // namespace graupel
