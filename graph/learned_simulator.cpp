#include "graph/learned_simulator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "graph/corrections/density_projection.h"
#include "graph/corrections/free_flight.h"
#include "graph/cpu/lap_timer.h"
#include "graph/cuda_simulator.h"
#include "graph/features/frame_step.h"
#include "graph/features/prescribed_positions.h"
#include "graph/features/rest_density.h"

namespace graupel::graph {

namespace {

bool about_equal(double a, double b) { return std::abs(a - b) <= 1e-3 * std::max(std::abs(a), std::abs(b)); }

void check_fit(const FeatureConfig& config, const Scene& scene, const Environment& environment,
               const std::string& file) {
  if (config.dimensions != scene.domain.dimensions)
    throw ConfigError("the network was trained for scenes with another number of dimensions (scene " +
                      std::to_string(scene.domain.dimensions) + ", '" + file + "' " +
                      std::to_string(config.dimensions) + "). Choose weights that were trained on such scenes");
  if (!about_equal(scene.frame_time, config.frame_time))
    throw ConfigError("the network was trained for another frame time (scene " + std::to_string(scene.frame_time) +
                      " s, '" + file + "' " + std::to_string(config.frame_time) + " s). Set the scene's frame_time");
  if (config.cell_normal && environment.obstacles.count() > 0 && !about_equal(environment.normal_spacing, config.dx))
    throw ConfigError("the network was trained with another cell size of the obstacle normals (scene " +
                      std::to_string(environment.normal_spacing) + " m, '" + file + "' " + std::to_string(config.dx) +
                      " m). Set the scene's domain.dx");
}

void check_start(const std::vector<std::vector<Vec3f>>& start, std::size_t frames, std::size_t particles) {
  if (start.size() < frames)
    throw InputError("the start of the rollout has too few frames (" + std::to_string(start.size()) +
                     ", needed at least " + std::to_string(frames) + "). Give more frames or start from the scene");
  for (const auto& frame : start) {
    if (frame.size() != particles)
      throw InputError("a start frame has another number of particles (" + std::to_string(frame.size()) +
                       ", particle types " + std::to_string(particles) + "). Use frames of one trajectory");
    for (const Vec3f& x : frame)
      if (!std::isfinite(x[0] + x[1] + x[2]))
        throw InputError("a start position is not finite. Use an earlier frame of that trajectory");
  }
}

/// Accelerations [m/frame^2] of what only falls.
std::vector<Vec3f> falling(const Scene& scene, const std::vector<int32_t>& particle_type) {
  const Vec3f fall = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
  std::vector<Vec3f> acceleration(particle_type.size(), Vec3f::zero());
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    if (moves_by_itself(particle_type[i])) acceleration[i] = fall;
  return acceleration;
}

ParticleFrame make_frame(int64_t number, double frame_time, const std::vector<Vec3f>& before,
                         const std::vector<Vec3f>& current) {
  ParticleFrame frame;
  frame.time = static_cast<double>(number) * frame_time;
  frame.position = current;
  frame.velocity.resize(current.size());
  const auto rate = static_cast<float>(1 / frame_time);
  for (std::size_t i = 0; i < current.size(); ++i) frame.velocity[i] = (current[i] - before[i]) * rate;
  return frame;
}

Trajectory empty_trajectory(const Scene& scene, const std::vector<int32_t>& particle_type, const std::string& made_by) {
  Trajectory trajectory;
  trajectory.particle_type = particle_type;
  trajectory.frame_time = scene.frame_time;
  trajectory.scene_json = scene.source;
  trajectory.seed = scene.seed;
  trajectory.made_by = made_by;
  return trajectory;
}

/// What rollouts on the CPU do to the frames that a network predicts; the density is held after the last one of a
/// bundle.
class Corrections {
 public:
  Corrections(const Scene& scene, const Environment& environment, const std::vector<int32_t>& particle_type,
              PrescribedPositions prescribed, const LearnedSimulator::RolloutOptions& options, const Network& network)
      : environment_(environment),
        prescribed_(std::move(prescribed)),
        bundle_(network.feature_config().bundle),
        project_(options.project) {
    const double spacing = network.spacing(),
                 rest = rest_density(scene, prescribed_.others(prescribed_.start()), spacing);
    if (options.density_limit * rest > 0 && !environment.plane)
      density_.emplace(Device::cpu, environment, options.density_limit * rest, spacing);
    if (options.free_flight && !prescribed_.any()) flight_.emplace(Device::cpu, scene, environment, particle_type);
  }

  /// Of frame number `frame`, with those before it.
  void apply(int64_t frame, const std::vector<Vec3f>& before, const std::vector<Vec3f>& current,
             std::vector<Vec3f>& next) {
    if (flight_) {
      flight_->find_groups(before.data(), current.data());
      flight_->correct(before.data(), current.data(), next.data());
    }
    if (project_) project_out(environment_, current, next);
    if (density_ && frame % bundle_ == 0) {
      free_ = next;
      hold_density(next);
      if (project_) project_out(environment_, free_, next);
    }
    keep_in_plane(environment_, next);
    prescribed_.put(frame, next);
  }

 private:
  void hold_density(std::vector<Vec3f>& position) {
    if (!prescribed_.any()) return density_->apply(position.data(), static_cast<int64_t>(position.size()));
    std::vector<Vec3f> others = prescribed_.others(position);
    density_->apply(others.data(), static_cast<int64_t>(others.size()));
    prescribed_.put_others(others, position);
  }

  const Environment& environment_;
  PrescribedPositions prescribed_;
  int64_t bundle_;
  bool project_;
  std::optional<DensityProjection> density_;
  std::optional<FreeFlight> flight_;
  std::vector<Vec3f> free_;  ///< out of obstacles
};

}  // namespace

LearnedSimulator::LearnedSimulator(const std::string& weights_file) {
  weights_ = std::make_shared<const nn::Weights>(nn::read_safetensors(weights_file));
  network_ = load_network(*weights_);
}

const FeatureConfig& LearnedSimulator::config() const { return network_->feature_config(); }
const nn::Weights& LearnedSimulator::weights() const { return *weights_; }

std::vector<std::vector<Vec3f>> LearnedSimulator::predict(const Environment& environment,
                                                          const std::vector<int32_t>& particle_type,
                                                          const std::vector<std::vector<Vec3f>>& positions,
                                                          FrameTiming& timing) const {
  if (config().in_plane() != environment.plane.has_value())
    throw ConfigError("'" + weights_->file + "' is for scenes with another number of dimensions (" +
                      std::to_string(config().dimensions) + "). Choose weights that were trained on such scenes");
  const Normalization& normalization = network_->normalization();
  const std::vector<float> output = network_->predict(environment, particle_type, positions, timing);
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

std::vector<Vec3f> LearnedSimulator::one_step(const Environment& environment, const std::vector<int32_t>& particle_type,
                                              const std::vector<std::vector<Vec3f>>& positions,
                                              FrameTiming* timing) const {
  FrameTiming spent;
  std::vector<Vec3f> first = std::move(predict(environment, particle_type, positions, spent).front());
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
  check_fit(config(), scene, environment, weights_->file);
  check_start(start, needed, particle_type.size());
  std::vector<std::vector<Vec3f>> history(start.end() - static_cast<std::ptrdiff_t>(needed), start.end());

  PrescribedPositions prescribed(particle_type, start.back(), options.given);
  if (options.device == Device::cuda) {
    prescribed.refuse_gpu();
    return rollout_on_gpu(scene, environment, particle_type, start, options);
  }
  Corrections corrections(scene, environment, particle_type, std::move(prescribed), options, *network_);
  Trajectory trajectory = empty_trajectory(scene, particle_type, weights_->file);
  trajectory.frames.push_back(make_frame(0, scene.frame_time, history[needed - 2], history[needed - 1]));
  std::vector<Vec3f> next;
  std::vector<std::vector<Vec3f>> acceleration;  // of the frames of a bundle
  FrameTiming frame_timing;
  for (int64_t frame = 1; frame <= options.frames; ++frame) {
    const int64_t in_bundle = (frame - 1) % config().bundle;
    LapTimer whole;
    if (in_bundle == 0 && !options.network)
      acceleration.assign(static_cast<std::size_t>(config().bundle), falling(scene, particle_type));
    if (in_bundle == 0 && options.network) {
      FrameTiming spent;
      acceleration = predict(environment, particle_type, history, spent);
      frame_timing = spent.shared_by(std::min(config().bundle, options.frames - frame + 1));
    }
    FrameTiming timing = frame_timing;
    if (!step_frame(scene, history[needed - 2], history[needed - 1], acceleration[static_cast<std::size_t>(in_bundle)],
                    next)) {
      trajectory.diverged_at_frame = frame;
      break;
    }
    LapTimer watch;
    corrections.apply(frame, history[needed - 2], history[needed - 1], next);
    timing.projection = watch.lap();
    std::rotate(history.begin(), history.begin() + 1, history.end());
    std::swap(history.back(), next);
    timing.wall = whole.lap();
    trajectory.frames.push_back(make_frame(frame, scene.frame_time, history[needed - 2], history[needed - 1]));
    if (options.progress) options.progress(frame, timing);
  }
  return trajectory;
}

CudaSimulator& LearnedSimulator::gpu_simulator() const {
  if (config().in_plane())
    throw ConfigError("'" + weights_->file +
                      "' is for scenes with two dimensions, which networks on a GPU do not roll out (dimensions 2, "
                      "allowed: 3). Use --device cpu");
  if (!on_gpu_) on_gpu_ = std::make_shared<CudaSimulator>(*weights_);
  return *on_gpu_;
}

Trajectory LearnedSimulator::rollout_on_gpu(const Scene& scene, const Environment& environment,
                                            const std::vector<int32_t>& particle_type,
                                            const std::vector<std::vector<Vec3f>>& start,
                                            const RolloutOptions& options) const {
  CudaSimulator& simulator = gpu_simulator();
  simulator.start(scene, environment, particle_type, start,
                  {options.project, options.density_limit, options.free_flight, options.network});
  Trajectory trajectory = empty_trajectory(scene, particle_type, weights_->file);
  std::vector<Vec3f> before = start.back();
  trajectory.frames.push_back(make_frame(0, scene.frame_time, start[start.size() - 2], before));
  for (int64_t frame = 1; frame <= options.frames; ++frame) {
    LapTimer whole;
    const bool goes_on = simulator.advance();
    const double wall = whole.lap();
    if (!goes_on) {
      trajectory.diverged_at_frame = frame;
      break;
    }
    std::vector<Vec3f> current = simulator.positions();
    trajectory.frames.push_back(make_frame(frame, scene.frame_time, before, current));
    before = std::move(current);
    const CudaFrameTime spent = simulator.frame_time();
    if (options.progress)
      options.progress(
          frame, {spent.features / 1e3, spent.hierarchy / 1e3, spent.network / 1e3, spent.projection / 1e3, wall});
  }
  return trajectory;
}

std::vector<Vec3f> LearnedSimulator::one_step_on_gpu(const Scene& scene, const Environment& environment,
                                                     const std::vector<int32_t>& particle_type,
                                                     const std::vector<std::vector<Vec3f>>& positions) const {
  CudaSimulator& simulator = gpu_simulator();
  simulator.start(scene, environment, particle_type, positions, {false, 0, false, true});
  return simulator.accelerations();
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
