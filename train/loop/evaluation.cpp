#include "train/loop/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "graph/features/frame_step.h"
#include "train/parallel/worker_threads.h"

namespace graupel::train {

namespace {

constexpr double airborne_tolerance = 0.05;  // of |g| dt^2
constexpr double near_cells = 2;             // in dx

/// Inputs of the network and the truth, for a few samples.
struct EvaluationBatch {
  Batch batch;
  std::vector<Vec3f> truth;        ///< [particles] [m/frame^2]
  std::vector<Vec3f> gravity;      ///< [scenes] [m/frame^2]
  std::vector<Region> region;      ///< [particles]
  std::vector<uint8_t> kinematic;  ///< [particles] 1 for those that do not count
};

/// Distance to the nearest wall that holds the material; negative outside.
double wall_distance(const graph::Environment& environment, const Vec3d& x) {
  double distance = std::numeric_limits<double>::infinity();
  for (int d = 0; d < 3; ++d)
    distance = std::min({distance, x[d] - environment.hold_low[d], environment.hold_high[d] - x[d]});
  return distance;
}

Region region_of(const SceneContext& context, const Vec3f& position, const Vec3f& acceleration) {
  const Vec3f gravity = context.gravity_step();
  if (norm(acceleration - gravity) < static_cast<float>(airborne_tolerance) * norm(gravity)) return Region::airborne;
  const double reach = near_cells * context.scene.domain.dx;
  const Vec3d x = position.cast<double>();
  if (wall_distance(context.environment, x) < reach) return Region::near_obstacle;
  const auto& obstacles = context.environment.obstacles;
  if (obstacles.count() > 0 && obstacles.sample(x).phi < reach) return Region::near_obstacle;
  return Region::bulk;
}

EvaluationBatch prepare(const NetworkConfig& config, const graph::Normalization& normalization, const DataSplit& split,
                        const SampleKey* first, const SampleKey* last) {
  EvaluationBatch prepared;
  std::vector<SceneGraph> graphs;
  for (const SampleKey* key = first; key != last; ++key) {
    const TrajectoryInfo& trajectory = split.trajectory(key->trajectory);
    const auto history = split.history(key->trajectory, key->frame, features_of(config).history);
    const auto truth = acceleration_of(split.positions(key->trajectory, key->frame + 1, 1).front(), history);
    graphs.push_back(scene_graph(config, normalization, trajectory, history, grid_origin(trajectory, config)));
    prepared.gravity.push_back(trajectory.context->gravity_step());
    for (std::size_t p = 0; p < truth.size(); ++p) {
      prepared.truth.push_back(truth[p]);
      prepared.region.push_back(region_of(*trajectory.context, history.back()[p], truth[p]));
      prepared.kinematic.push_back(trajectory.is_kinematic(p) ? 1 : 0);
    }
  }
  prepared.batch = concatenate(graphs);
  return prepared;
}

/// From normalised accelerations [particles, 3 bundle]; those of a bundle's first frame count.
void accumulate(const EvaluationBatch& prepared, const std::vector<float>& predicted,
                const graph::FeatureConfig& config, const graph::Normalization& normalization, OneStepErrors& errors) {
  const auto width = static_cast<std::size_t>(config.output_width());
  for (int64_t s = 0; s < prepared.batch.scenes(); ++s)
    for (int64_t p = prepared.batch.particle_begin[static_cast<std::size_t>(s)];
         p < prepared.batch.particle_begin[static_cast<std::size_t>(s) + 1]; ++p) {
      const auto at = static_cast<std::size_t>(p);
      if (prepared.kinematic[at]) continue;
      const Vec3f guess = graph::real_acceleration(normalization, config.in_plane(), predicted.data() + width * at);
      SquaredErrors& sums = errors.region[static_cast<std::size_t>(prepared.region[at])];
      ++sums.particles;
      for (int d = 0; d < 3; ++d) {
        const double deviation = normalization.acceleration_std[d], truth = prepared.truth[at][d];
        const double guesses[3] = {guess[d], 0.0, prepared.gravity[static_cast<std::size_t>(s)][d]};
        for (std::size_t g = 0; g < 3; ++g) {
          const double error = guesses[g] - truth;
          sums.raw[g] += error * error;
          sums.normalized[g] += error * error / (deviation * deviation);
        }
      }
    }
  errors.samples += prepared.batch.scenes();
}

/// Histories of the scenes of a rollout, newest last.
using Histories = std::vector<std::vector<std::vector<Vec3f>>>;

/// Normalised accelerations of a bundle of frames, of the particles of all scenes.
struct Prediction {
  std::vector<float> output;  ///< [particles, 3 bundle]
  std::vector<int64_t> first_particle;
  graph::FeatureConfig config;

  /// Of scene s in a frame of the bundle [m/frame^2].
  std::vector<Vec3f> accelerations(std::size_t s, int64_t frame, const TrajectoryInfo& trajectory,
                                   const graph::Normalization& normalization) const {
    const int64_t bundle = config.bundle;
    std::vector<Vec3f> acceleration(static_cast<std::size_t>(first_particle[s + 1] - first_particle[s]));
    const float* guess = output.data() + 3 * (bundle * first_particle[s] + frame);
    for (std::size_t p = 0; p < acceleration.size(); ++p) {
      acceleration[p] = trajectory.is_kinematic(p) ? Vec3f::zero()
                                                   : graph::real_acceleration(normalization, config.in_plane(), guess);
      guess += 3 * bundle;
    }
    return acceleration;
  }
};

Prediction predict(const NetworkModule& module, const graph::Normalization& normalization, const DataSplit& split,
                   const Histories& histories, const EvaluationOptions& options) {
  std::vector<SceneGraph> graphs(histories.size());
  for_each_index(options.threads, static_cast<int64_t>(histories.size()), [&](int64_t s) {
    const TrajectoryInfo& trajectory = split.trajectory(static_cast<int>(s));
    graphs[static_cast<std::size_t>(s)] =
        scene_graph(module.config(), normalization, trajectory, histories[static_cast<std::size_t>(s)],
                    grid_origin(trajectory, module.config()));
  });
  const Batch batch = concatenate(graphs);
  return {module.predict(batch, options.which), batch.particle_begin, features_of(module.config())};
}

/// Advances every history to that frame of the prediction's bundle; false when one of them diverged. Held particles go
/// where the `truth` [scenes][n] of the next frame has them.
bool advance(const Prediction& predicted, int64_t frame, const graph::Normalization& normalization,
             const DataSplit& split, const std::vector<std::vector<Vec3f>>& truth, Histories& histories) {
  for (std::size_t s = 0; s < histories.size(); ++s) {
    auto& history = histories[s];
    const std::vector<Vec3f>&current = history.back(), &before = history[history.size() - 2];
    const TrajectoryInfo& trajectory = split.trajectory(static_cast<int>(s));
    const SceneContext& context = *trajectory.context;
    std::vector<Vec3f> next;
    if (!graph::step_frame(context.scene, before, current, predicted.accelerations(s, frame, trajectory, normalization),
                           next))
      return false;
    graph::project_out(context.environment, current, next);
    graph::keep_in_plane(context.environment, next);
    for (std::size_t p = 0; p < next.size(); ++p)
      if (trajectory.is_kinematic(p)) next[p] = truth[s][p];
    history.erase(history.begin());
    history.push_back(std::move(next));
  }
  return true;
}

}  // namespace

const char* name_of(Region region) {
  constexpr const char* names[] = {"airborne", "near_obstacle", "bulk"};
  return names[static_cast<std::size_t>(region)];
}

const char* name_of(Predictor predictor) {
  constexpr const char* names[] = {"network", "zero", "ballistic"};
  return names[static_cast<std::size_t>(predictor)];
}

void SquaredErrors::add(const SquaredErrors& other) {
  for (std::size_t g = 0; g < 3; ++g) {
    raw[g] += other.raw[g];
    normalized[g] += other.normalized[g];
  }
  particles += other.particles;
}

double SquaredErrors::raw_mse(Predictor predictor) const {
  return particles > 0 ? raw[static_cast<std::size_t>(predictor)] / static_cast<double>(particles) : 0;
}

double SquaredErrors::normalized_mse(Predictor predictor) const {
  return particles > 0 ? normalized[static_cast<std::size_t>(predictor)] / static_cast<double>(particles) : 0;
}

SquaredErrors OneStepErrors::all() const {
  SquaredErrors sum;
  for (const SquaredErrors& one : region) sum.add(one);
  return sum;
}

OneStepErrors evaluate_one_step(const NetworkModule& module, const graph::Normalization& normalization,
                                const DataSplit& split, const std::vector<SampleKey>& samples,
                                const EvaluationOptions& options) {
  const auto total = static_cast<int64_t>(samples.size());
  const int64_t batches = (total + options.batch_scenes - 1) / options.batch_scenes;
  OrderedQueue<EvaluationBatch> queue(options.threads, 0, batches, options.threads + 2, [&](int64_t b) {
    const int64_t last = std::min(total, (b + 1) * options.batch_scenes);
    return prepare(module.config(), normalization, split, samples.data() + b * options.batch_scenes,
                   samples.data() + last);
  });
  OneStepErrors errors;
  for (int64_t b = 0; b < batches; ++b) {
    const EvaluationBatch prepared = queue.next();
    accumulate(prepared, module.predict(prepared.batch, options.which), features_of(module.config()), normalization,
               errors);
  }
  return errors;
}

double evaluate_rollout(const NetworkModule& module, const graph::Normalization& normalization, const DataSplit& split,
                        int64_t scenes, int64_t frames, const EvaluationOptions& options) {
  scenes = std::min<int64_t>(scenes, split.count());
  Histories histories;
  for (int64_t s = 0; s < scenes; ++s) {
    histories.push_back(split.history(static_cast<int>(s), 0, features_of(module.config()).history));
    frames = std::min(frames, split.trajectory(static_cast<int>(s)).frames - 1);
  }
  Prediction predicted;
  double sum = 0;
  int64_t count = 0;
  for (int64_t t = 1; t <= frames; ++t) {
    const int64_t in_bundle = (t - 1) % features_of(module.config()).bundle;
    if (in_bundle == 0) predicted = predict(module, normalization, split, histories, options);
    std::vector<std::vector<Vec3f>> truth;
    for (std::size_t s = 0; s < histories.size(); ++s)
      truth.push_back(split.positions(static_cast<int>(s), t, 1).front());
    if (!advance(predicted, in_bundle, normalization, split, truth, histories))
      return std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < histories.size(); ++s) {
      const TrajectoryInfo& trajectory = split.trajectory(static_cast<int>(s));
      for (std::size_t p = 0; p < truth[s].size(); ++p)
        if (!trajectory.is_kinematic(p)) sum += norm2((histories[s].back()[p] - truth[s][p]).cast<double>());
      count += static_cast<int64_t>(truth[s].size()) - trajectory.kinematic_count();
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

}  // namespace graupel::train
