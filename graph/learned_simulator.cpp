#include "graph/learned_simulator.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

#include "core/scene/kinematic_particles.h"
#include "core/scene/materials_by_type.h"
#include "core/scene/particle_rows.h"
#include "core/system/error.h"
#include "graph/config/network_config.h"
#include "graph/corrections/frame_corrections.h"
#include "graph/cpu/lap_timer.h"
#include "graph/cuda_simulator.h"
#include "graph/features/frame_step.h"
#include "graph/features/obstacle_particles.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/features/periodic_images.h"
#include "graph/features/prescribed_positions.h"
#include "graph/rollout_parts.h"

namespace graupel::graph {

namespace {

using Frames = std::vector<std::vector<Vec3f>>;  ///< positions [frames][n]

/// The particles of a step: all, where none come or go, else copies of those in the run.
class StepParticles {
 public:
  StepParticles(const ParticleLifecycle& lifecycle, const std::vector<int32_t>& type,
                const std::vector<int32_t>& material, const Frames& history, const std::vector<uint8_t>& kinematic)
      : place_(lifecycle.changes() ? &lifecycle.present() : nullptr),
        type_(type),
        material_(material),
        history_(history),
        kinematic_(kinematic) {
    if (place_ == nullptr) return;
    own_type_ = particle_rows(type, *place_);
    own_material_ = particle_rows(material, *place_);
    own_kinematic_ = particle_rows(kinematic, *place_);
    for (const std::vector<Vec3f>& frame : history) own_history_.push_back(particle_rows(frame, *place_));
  }
  const std::vector<int32_t>& type() const { return place_ != nullptr ? own_type_ : type_; }
  const std::vector<int32_t>& material() const { return place_ != nullptr ? own_material_ : material_; }
  const std::vector<uint8_t>& kinematic() const { return place_ != nullptr ? own_kinematic_ : kinematic_; }
  const Frames& history() const { return place_ != nullptr ? own_history_ : history_; }
  /// Their rows among those of all.
  const std::vector<Vec3f>& rows(const std::vector<Vec3f>& of_all) {
    if (place_ == nullptr) return of_all;
    own_rows_ = particle_rows(of_all, *place_);
    return own_rows_;
  }
  /// Puts their rows into those of all: the others keep what is there.
  void put(std::vector<Vec3f>& rows, std::vector<Vec3f>& of_all) const {
    if (place_ == nullptr) {
      std::swap(of_all, rows);
      return;
    }
    for (std::size_t k = 0; k < place_->size(); ++k) of_all[static_cast<std::size_t>((*place_)[k])] = rows[k];
  }

 private:
  const std::vector<int32_t>* place_;
  const std::vector<int32_t>&type_, &material_;
  const Frames& history_;
  const std::vector<uint8_t>& kinematic_;
  std::vector<int32_t> own_type_, own_material_;
  Frames own_history_;
  std::vector<uint8_t> own_kinematic_;
  std::vector<Vec3f> own_rows_;
};

/// Whether obstacles are particles to the network.
bool sees_obstacle_particles(const nn::Weights& weights) {
  const NetworkConfig config = network_config_of(weights);
  const auto* gns = std::get_if<GnsConfig>(&config);
  return gns != nullptr && gns->obstacle_particles;
}

}  // namespace

LearnedSimulator::LearnedSimulator(const std::string& weights_file)
    : LearnedSimulator(std::make_shared<const nn::Weights>(nn::read_safetensors(weights_file))) {}

LearnedSimulator::LearnedSimulator(std::shared_ptr<const nn::Weights> weights)
    : network_(load_network(*weights)), weights_(std::move(weights)) {}

const FeatureConfig& LearnedSimulator::config() const { return network_->feature_config(); }
const nn::Weights& LearnedSimulator::weights() const { return *weights_; }

void LearnedSimulator::check_scene(const Scene& scene) const {
  check_fit(config(), scene, scene.domain.dx, weights_->file);
  for (const auto& [name, material] : materials_in_use(scene)) embedding_row(particle_type_of(material.model));
  if (sees_obstacle_particles(*weights_)) check_obstacle_particles(scene);
}

std::vector<std::vector<Vec3f>> LearnedSimulator::predict(const Environment& environment,
                                                          const std::vector<int32_t>& particle_type,
                                                          const std::vector<int32_t>& material,
                                                          const std::vector<std::vector<Vec3f>>& positions,
                                                          Device device, FrameTiming& timing) const {
  if (config().in_plane() != environment.plane.has_value())
    throw ConfigError("'" + weights_->file + "' is for scenes with another number of dimensions (" +
                      std::to_string(config().dimensions) + "). Choose weights that were trained on such scenes");
  const Normalization& normalization = network_->normalization();
  const NetworkEngine on_gpu = [this](const std::vector<float>& features, const std::vector<int32_t>& type,
                                      const std::vector<Vec3f>& position, const Vec3d& origin,
                                      std::vector<float>& output) {
    gpu_simulator().evaluate(features, type, position, origin, output);
  };
  const std::vector<float> output = network_->predict(environment, particle_type, material, positions, timing,
                                                      device == Device::cuda ? &on_gpu : nullptr);
  std::vector<std::vector<Vec3f>> acceleration(static_cast<std::size_t>(config().bundle),
                                               std::vector<Vec3f>(particle_type.size()));
  const float* number = output.data();
  for (std::size_t i = 0; i < particle_type.size(); ++i)
    for (std::vector<Vec3f>& frame : acceleration) {
      frame[i] = moves_by_itself(particle_type[i]) ? real_acceleration(normalization, config().in_plane(), number)
                                                   : Vec3f::zero();
      number += 3;
    }
  return acceleration;
}

std::vector<int32_t> LearnedSimulator::seen_materials(const Environment& environment,
                                                      const std::vector<int32_t>& particle_type,
                                                      const std::vector<int32_t>& material) const {
  if (!config().material_constants) return {};
  if (material.empty()) return environment.materials.by_type(particle_type);
  GRAUPEL_ASSERT(material.size() == particle_type.size());
  return material;
}

std::vector<Vec3f> LearnedSimulator::one_step(const Environment& environment, const std::vector<int32_t>& particle_type,
                                              const std::vector<std::vector<Vec3f>>& positions, FrameTiming* timing,
                                              const std::vector<int32_t>& material) const {
  FrameTiming spent;
  const std::vector<int32_t> seen = seen_materials(environment, particle_type, material);
  std::vector<Vec3f> first =
      std::move(predict(environment, particle_type, seen, positions, Device::cpu, spent).front());
  if (timing != nullptr) *timing = spent;
  return first;
}

double LearnedSimulator::flop(const Environment& environment, const std::vector<Vec3f>& position) const {
  return network_->flop(environment, position) / static_cast<double>(config().bundle);
}

Trajectory LearnedSimulator::rollout(const Scene& scene, const Environment& environment,
                                     const std::vector<int32_t>& particle_type,
                                     const std::vector<std::vector<Vec3f>>& start,
                                     const RolloutOptions& options) const {
  const auto needed = static_cast<std::size_t>(config().history) + 1;
  check_fit(config(), scene, environment.normal_spacing, weights_->file);
  check_start(start, needed, particle_type.size());
  check_schedule(scene, options.schedule, particle_type.size());
  const std::vector<int32_t> material = seen_materials(environment, particle_type, options.material);
  PrescribedPositions prescribed(particle_type, start.back(), options.given);
  if (options.schedule != nullptr)
    prescribed.add_scripts(*options.schedule, options.start_time, scene.frame_time, environment.plane.has_value());
  ParticleLifecycle lifecycle(scene, options.schedule, start.back(), options.active, options.start_time);
  if (options.device == Device::cuda) {
    if (what_changes(environment, prescribed, lifecycle).empty())
      return rollout_on_gpu(scene, environment, particle_type, material, start, options);
    if (!prescribed.any() && !environment.is_periodic() && !environment.plane &&
        !(environment.moves() && sees_obstacle_particles(*weights_)))
      return rollout_changing_on_gpu(scene, environment, particle_type, material, start, options, lifecycle);
  }

  Frames history(start.end() - static_cast<std::ptrdiff_t>(needed), start.end());
  if (options.schedule != nullptr) add_past_of_born(scene, *options.schedule, options.start_time, history);
  unwrap_periodic(environment, history);
  MovingEnvironment moving_environment(environment);
  FrameCorrections corrections(
      scene, environment, matter_at(start.back(), prescribed.mask(0), lifecycle),
      {options.project, options.density_limit, options.free_flight, config().bundle, network_->spacing()});
  Trajectory trajectory = empty_trajectory(scene, particle_type, weights_->file);
  trajectory.frames.push_back(
      make_frame(options.start_time, scene.frame_time, history[needed - 2], history[needed - 1], lifecycle.active()));
  std::vector<Vec3f> next, all_next;
  Frames acceleration;  // of the frames of a bundle
  FrameTiming frame_timing;
  bool other_particles = false;
  for (int64_t frame = 1; frame <= options.frames; ++frame) {
    const int64_t in_bundle = (frame - 1) % config().bundle;
    const double from = options.start_time + static_cast<double>(frame - 1) * scene.frame_time,
                 to = options.start_time + static_cast<double>(frame) * scene.frame_time;
    LapTimer whole;
    const Environment& here = moving_environment.at(to);
    const std::vector<uint8_t> kinematic = prescribed.mask(frame);
    StepParticles step(lifecycle, particle_type, material, history, kinematic);
    if (in_bundle == 0) {
      FrameTiming spent;
      const double placing = whole.lap();
      Frames predicted = options.network
                             ? predict(here, step.type(), step.material(), step.history(), options.device, spent)
                             : Frames(static_cast<std::size_t>(config().bundle), falling(scene, step.type()));
      spent.features += here.moves() ? placing : 0;
      frame_timing =
          options.network ? spent.shared_by(std::min(config().bundle, options.frames - frame + 1)) : FrameTiming();
      // What appears within the bundle falls until the next one.
      acceleration.assign(predicted.size(), lifecycle.changes() ? falling(scene, particle_type) : std::vector<Vec3f>());
      for (std::size_t j = 0; j < predicted.size(); ++j) step.put(predicted[j], acceleration[j]);
    }
    FrameTiming timing = frame_timing;
    const Frames& known = step.history();
    if (!step_frame(scene, known[needed - 2], known[needed - 1],
                    step.rows(acceleration[static_cast<std::size_t>(in_bundle)]), next)) {
      trajectory.diverged_at_frame = frame;
      break;
    }
    LapTimer watch;
    corrections.apply(
        {frame, from, here, step.type(), other_particles, step.kinematic(), known[needed - 2], known[needed - 1]},
        next);
    if (lifecycle.changes()) all_next = history.back();
    step.put(next, all_next);
    prescribed.put(frame, all_next);
    timing.projection = watch.lap();
    std::rotate(history.begin(), history.begin() + 1, history.end());
    std::swap(history.back(), all_next);
    const bool some_gone = lifecycle.leave(here, kinematic, history), some_new = lifecycle.appear(here, history, to);
    other_particles = some_gone || some_new;
    timing.wall = whole.lap();
    trajectory.frames.push_back(
        make_frame(to, scene.frame_time, history[needed - 2], history[needed - 1], lifecycle.active()));
    if (options.progress) options.progress(frame, timing);
  }
  return trajectory;
}

void LearnedSimulator::check_runs_on(Device device) const {
  if (device == Device::cuda) static_cast<void>(CudaSimulator(*weights_));
}

std::vector<std::vector<Vec3f>> start_history(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                                              const Vec3d& gravity, double frame_time, int frames,
                                              const std::vector<uint8_t>& kinematic) {
  GRAUPEL_ASSERT(velocity.size() == position.size() && frames >= 1);
  std::vector<std::vector<Vec3f>> history(static_cast<std::size_t>(frames), position);
  for (int k = 1; k < frames; ++k) {
    const double t = k * frame_time;
    std::vector<Vec3f>& frame = history[static_cast<std::size_t>(frames - 1 - k)];
    for (std::size_t i = 0; i < position.size(); ++i) {
      const bool falls = kinematic.empty() || kinematic[i] == 0;
      const Vec3d fallen = gravity * (falls ? t * t / 2 : 0);
      frame[i] = (position[i].cast<double>() - velocity[i].cast<double>() * t + fallen).cast<float>();
    }
  }
  return history;
}

}  // namespace graupel::graph
