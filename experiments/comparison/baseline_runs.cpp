#include "experiments/comparison/baseline_runs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/models/memory_meter.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

namespace {

using Positions = std::function<std::vector<Vec3f>(int64_t)>;

TimedRun timed_run(const compare::ParticleRun& truth, const Positions& positions) {
  const MemoryMeter memory;
  TimedRun result;
  result.run.mass = truth.mass;
  result.run.volume = truth.volume;
  result.moved = truth.size();
  Trajectory& trajectory = result.run.trajectory;
  trajectory.particle_type = truth.trajectory.particle_type;
  trajectory.frame_time = truth.trajectory.frame_time;
  trajectory.seed = truth.trajectory.seed;
  trajectory.frames.push_back({.time = 0, .position = truth.position(0), .velocity = {}});
  std::vector<double> seconds;
  for (std::size_t f = 1; f <= truth.predicted(); ++f) {
    stop_if_interrupted();
    const Stopwatch watch;
    ParticleFrame frame{
        .time = truth.trajectory.frames[f].time, .position = positions(static_cast<int64_t>(f)), .velocity = {}};
    seconds.push_back(watch.seconds());
    trajectory.frames.push_back(std::move(frame));
  }
  result.cost.frame = median(seconds);
  result.cost.substeps = 0;
  result.cost.peak_bytes = memory.peak();
  result.cost.added_bytes = memory.added();
  return result;
}

}  // namespace

void check_training_runs(const TrainingRuns& runs, const LoadedModel& model, const SceneTask& task) {
  runs.parameters_in(task.scene, task.seed, task.frames);
  std::vector<std::string> names;
  for (const rom::ModelParameter& p : model.model.parameters) names.push_back(p.name);
  if (names != runs.names())
    throw ConfigError(fmt::format(
        "'{}' was trained on other parameters ({}) than the training runs have ({}). Name the data set of its training "
        "with --training-runs",
        model.file, fmt::join(names, ", "), fmt::join(runs.names(), ", ")));
}

std::vector<BaselineRun> baseline_runs(const TrainingRuns* runs, const SceneTask& task,
                                       const compare::ParticleRun& truth) {
  std::vector<BaselineRun> baselines;
  baselines.push_back({"nothing-moves", "", timed_run(truth, [&](int64_t) { return truth.position(0); })});
  if (runs == nullptr) return baselines;
  const std::vector<double> own = runs->parameters_in(task.scene, task.seed, task.frames);
  const auto add = [&](const char* name, const TrainingMix& mix) {
    baselines.push_back({name, runs->text(mix), timed_run(truth, [&](int64_t frame) {
                           std::vector<Vec3f> positions;
                           for (const Vec3d& x : runs->positions(mix, frame)) positions.push_back(x.cast<float>());
                           return positions;
                         })});
  };
  const TrainingMix nearest = nearest_run(runs->parameters(), own);
  if (runs->particles(nearest.runs.front()) != truth.size())
    throw InputError(
        fmt::format("'{}' has {} particles, the nearest run of --training-runs {} (allowed: the same body). Leave "
                    "--training-runs out",
                    task.scene.name, truth.size(), runs->particles(nearest.runs.front())));
  add("nearest-run", nearest);
  if (runs->parameters()[static_cast<std::size_t>(nearest.runs.front())] == own)
    baselines.back().note += ": this scene is a training run";
  if (const auto around = runs_around(runs->parameters(), own)) {
    add("between-runs", *around);
  } else if (const auto beyond = runs_beyond(runs->parameters(), own)) {
    add("beyond-runs", *beyond);
  }
  return baselines;
}

}  // namespace graupel::experiments
