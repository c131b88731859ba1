#include "train/loop/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/scene/particle_rows.h"
#include "graph/features/frame_step.h"
#include "graph/features/particle_lifecycle.h"
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
  std::vector<uint8_t> uncounted;  ///< [particles] 1 for those that do not count
};

/// Distance to the nearest wall that holds the material; negative outside.
double wall_distance(const graph::Environment& environment, const Vec3d& x) {
  double distance = std::numeric_limits<double>::infinity();
  for (int d = 0; d < 3; ++d)
    distance = std::min({distance, x[d] - environment.hold_low[d], environment.hold_high[d] - x[d]});
  return distance;
}

Region region_of(const SceneContext& context, const graph::Environment& environment, const Vec3f& position,
                 const Vec3f& acceleration) {
  const Vec3f gravity = context.gravity_step();
  if (norm(acceleration - gravity) < static_cast<float>(airborne_tolerance) * norm(gravity)) return Region::airborne;
  const double reach = near_cells * context.scene.domain.dx;
  const Vec3d x = position.cast<double>();
  if (wall_distance(environment, x) < reach) return Region::near_obstacle;
  if (environment.obstacles.count() > 0 && environment.obstacles.sample(x).phi < reach) return Region::near_obstacle;
  return Region::bulk;
}

EvaluationBatch prepare(const NetworkConfig& config, const graph::Normalization& normalization, const DataSplit& split,
                        const SampleKey* first, const SampleKey* last) {
  EvaluationBatch prepared;
  std::vector<SceneGraph> graphs;
  for (const SampleKey* key = first; key != last; ++key) {
    const TrajectoryInfo& trajectory = split.trajectory(key->trajectory);
    const std::vector<int32_t> present = trajectory.present(key->frame);
    const auto history = frame_rows(split.history(key->trajectory, key->frame, features_of(config).history), present);
    const auto truth =
        acceleration_of(particle_rows(split.positions(key->trajectory, key->frame + 1, 1).front(), present), history);
    graph::MovingEnvironment moving_environment(trajectory.context->environment);
    const graph::Environment& environment = moving_environment.at(trajectory.context->time_of(key->frame + 1));
    graphs.push_back(scene_graph(config, normalization, environment, trajectory.kinds(present), history,
                                 grid_origin(trajectory, config)));
    prepared.gravity.push_back(trajectory.context->gravity_step());
    for (std::size_t row = 0; row < truth.size(); ++row) {
      prepared.truth.push_back(truth[row]);
      prepared.region.push_back(region_of(*trajectory.context, environment, history.back()[row], truth[row]));
      const auto p = static_cast<std::size_t>(present[row]);
      prepared.uncounted.push_back(trajectory.counts(p, key->frame, key->frame + 1) ? 0 : 1);
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
      if (prepared.uncounted[at]) continue;
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

/// A scene that is rolled out from its first frame.
struct Rollout {
  Rollout(const DataSplit& split, int number, int64_t history_length)
      : trajectory(split.trajectory(number)),
        moving_environment(trajectory.context->environment),
        history(split.history(number, 0, history_length)),
        lifecycle(trajectory.context->scene, &trajectory.schedule, history.back(), active_at_start(trajectory), 0) {}

  /// Particles in the run, ascending.
  std::vector<int32_t> present() const {
    if (lifecycle.changes()) return lifecycle.present();
    return trajectory.present(0);
  }
  bool is_in_run(std::size_t p) const { return !lifecycle.changes() || lifecycle.active()[p] != 0; }
  /// To a frame, by accelerations [n] of the particles in the run [m/frame^2]; false when it diverged. Kinematic
  /// particles go where the `truth` [n] of that frame has them.
  bool advance(int64_t frame, const std::vector<Vec3f>& acceleration, const std::vector<Vec3f>& truth);

  const TrajectoryInfo& trajectory;
  graph::MovingEnvironment moving_environment;
  std::vector<std::vector<Vec3f>> history;  ///< newest last
  graph::ParticleLifecycle lifecycle;
  std::vector<std::vector<Vec3f>> predicted;  ///< accelerations [m/frame^2] of a bundle's frames [bundle][n]

 private:
  static std::vector<uint8_t> active_at_start(const TrajectoryInfo& trajectory) {
    std::vector<uint8_t> active;
    for (const FramesInRun& span : trajectory.in_run) active.push_back(span.holds(0, 0) ? 1 : 0);
    return active;
  }
};

bool Rollout::advance(int64_t frame, const std::vector<Vec3f>& acceleration, const std::vector<Vec3f>& truth) {
  const SceneContext& context = *trajectory.context;
  const graph::Environment& environment = moving_environment.at(context.time_of(frame));
  const std::vector<int32_t> present = this->present();
  const std::vector<Vec3f> current = particle_rows(history.back(), present),
                           before = particle_rows(history[history.size() - 2], present);
  std::vector<Vec3f> next, all_next = history.back();
  if (!graph::step_frame(context.scene, before, current, particle_rows(acceleration, present), next)) return false;
  graph::project_out(environment, current, next, context.time_of(frame - 1));
  graph::keep_in_plane(environment, next);
  for (std::size_t row = 0; row < present.size(); ++row) {
    const auto p = static_cast<std::size_t>(present[row]);
    all_next[p] = trajectory.is_kinematic(p) ? truth[p] : next[row];
  }
  history.erase(history.begin());
  history.push_back(std::move(all_next));
  lifecycle.leave(environment, trajectory.kinematic, history);
  lifecycle.appear(environment, history, context.time_of(frame));
  return true;
}

/// What the network says of the bundle of frames that begins with `frame`, of all rollouts. Particles that appear
/// within it fall.
void predict(const NetworkModule& module, const graph::Normalization& normalization, int64_t frame,
             std::vector<Rollout>& rollouts, const EvaluationOptions& options) {
  const graph::FeatureConfig config = features_of(module.config());
  std::vector<SceneGraph> graphs(rollouts.size());
  for_each_index(options.threads, static_cast<int64_t>(rollouts.size()), [&](int64_t s) {
    Rollout& rollout = rollouts[static_cast<std::size_t>(s)];
    const TrajectoryInfo& trajectory = rollout.trajectory;
    const std::vector<int32_t> present = rollout.present();
    rollout.predicted.assign(static_cast<std::size_t>(config.bundle),
                             std::vector<Vec3f>(trajectory.type_row.size(), trajectory.context->gravity_step()));
    if (present.empty()) return;
    graphs[static_cast<std::size_t>(s)] = scene_graph(
        module.config(), normalization, rollout.moving_environment.at(trajectory.context->time_of(frame)),
        trajectory.kinds(present), frame_rows(rollout.history, present), grid_origin(trajectory, module.config()));
  });
  std::erase_if(graphs, [](const SceneGraph& graph) { return graph.type_row.empty(); });
  if (graphs.empty()) return;
  const std::vector<float> output = module.predict(concatenate(graphs), options.which);
  const float* guess = output.data();
  for (Rollout& rollout : rollouts)
    for (const int32_t particle : rollout.present())
      for (std::vector<Vec3f>& accelerations : rollout.predicted) {
        const auto p = static_cast<std::size_t>(particle);
        accelerations[p] = rollout.trajectory.is_kinematic(p)
                               ? Vec3f::zero()
                               : graph::real_acceleration(normalization, config.in_plane(), guess);
        guess += 3;
      }
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
  for (int64_t b = 0; b < batches && !(options.should_stop && options.should_stop()); ++b) {
    const EvaluationBatch prepared = queue.next();
    accumulate(prepared, module.predict(prepared.batch, options.which), features_of(module.config()), normalization,
               errors);
  }
  return errors;
}

double evaluate_rollout(const NetworkModule& module, const graph::Normalization& normalization, const DataSplit& split,
                        int64_t scenes, int64_t frames, const EvaluationOptions& options) {
  scenes = std::min<int64_t>(scenes, split.count());
  std::vector<Rollout> rollouts;
  for (int64_t s = 0; s < scenes; ++s) {
    rollouts.emplace_back(split, static_cast<int>(s), features_of(module.config()).history);
    frames = std::min(frames, split.trajectory(static_cast<int>(s)).frames - 1);
  }
  double sum = 0;
  int64_t count = 0;
  for (int64_t t = 1; t <= frames && !(options.should_stop && options.should_stop()); ++t) {
    const int64_t in_bundle = (t - 1) % features_of(module.config()).bundle;
    if (in_bundle == 0) predict(module, normalization, t, rollouts, options);
    for (std::size_t s = 0; s < rollouts.size(); ++s) {
      Rollout& rollout = rollouts[s];
      const std::vector<Vec3f> truth = split.positions(static_cast<int>(s), t, 1).front();
      if (!rollout.advance(t, rollout.predicted[static_cast<std::size_t>(in_bundle)], truth))
        return std::numeric_limits<double>::infinity();
      for (std::size_t p = 0; p < truth.size(); ++p) {
        if (!rollout.trajectory.counts(p, t, t) || !rollout.is_in_run(p)) continue;
        sum += norm2((rollout.history.back()[p] - truth[p]).cast<double>());
        ++count;
      }
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

}  // namespace graupel::train
