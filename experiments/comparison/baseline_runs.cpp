#include "experiments/comparison/baseline_runs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>
#include <optional>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/models/body_points.h"
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
  trajectory.frames.back().active = truth.trajectory.frames.front().active;
  std::vector<double> seconds;
  for (std::size_t f = 1; f <= truth.predicted(); ++f) {
    stop_if_interrupted();
    const Stopwatch watch;
    ParticleFrame frame{
        .time = truth.trajectory.frames[f].time, .position = positions(static_cast<int64_t>(f)), .velocity = {}};
    frame.active = truth.trajectory.frames[f].active;
    seconds.push_back(watch.seconds());
    trajectory.frames.push_back(std::move(frame));
  }
  result.cost.frame = median(seconds);
  result.cost.substeps = 0;
  result.cost.peak_bytes = memory.peak();
  result.cost.added_bytes = memory.added();
  return result;
}

/// Training runs at the truth's particles.
class RunsOnTruth {
 public:
  RunsOnTruth(const TrainingRuns& runs, const SceneTask& task, const compare::ParticleRun& truth)
      : runs_(runs), truth_(truth.size()) {
    const Scene scene = runs.scene();
    const mpm::SampledParticles theirs = mpm::sample_sources(scene, scene.seed),
                                own = mpm::sample_sources(task.scene, task.seed);
    const bool same = theirs.position == own.position;
    if (runs.particles(0) != (same ? truth.size() : theirs.position.size()) || (!same && own.position.size() != truth_))
      throw InputError(
          fmt::format("'{}' has {} particles, the first run of --training-runs {} (allowed: the same body). Leave "
                      "--training-runs out",
                      task.scene.name, truth_, runs.particles(0)));
    if (same) return;
    rom::ReferencePoints points{{}, particle_kinds(own)};
    for (const Vec3d& x : own.position) points.position.push_back(x.cast<float>());
    carried_.resize(static_cast<std::size_t>(3 * mpm::padded_to_tile(static_cast<int64_t>(own.position.size()))));
    motion_.emplace(interpolation_particles(scene, theirs), std::move(points));
  }

  std::vector<Vec3f> positions(const TrainingMix& mix, int64_t frame) {
    const std::vector<Vec3d> at_particles = runs_.positions(mix, frame);
    std::vector<Vec3f> positions;
    if (!motion_) {
      for (const Vec3d& x : at_particles) positions.push_back(x.cast<float>());
      return positions;
    }
    std::vector<float> tiles(
        static_cast<std::size_t>(3 * mpm::padded_to_tile(static_cast<int64_t>(at_particles.size()))));
    for (std::size_t p = 0; p < at_particles.size(); ++p)
      mpm::TiledView<float, 3>{tiles.data()}.set_vec(static_cast<int64_t>(p), at_particles[p].cast<float>());
    motion_->take(tiles.data(), nullptr);
    motion_->carry(carried_.data(), nullptr, nullptr);
    positions.resize(truth_);
    for (std::size_t p = 0; p < truth_; ++p)
      positions[p] = mpm::TiledView<float, 3>{carried_.data()}.vec(static_cast<int64_t>(p));
    return positions;
  }

 private:
  const TrainingRuns& runs_;
  std::size_t truth_;  ///< its particles
  std::optional<rom::MlsMotion<float>> motion_;
  std::vector<float> carried_;  ///< tiled
};

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
  RunsOnTruth on_truth(*runs, task, truth);
  const auto add = [&](const char* name, const TrainingMix& mix) {
    baselines.push_back(
        {name, runs->text(mix), timed_run(truth, [&](int64_t frame) { return on_truth.positions(mix, frame); })});
  };
  const TrainingMix nearest = nearest_run(runs->parameters(), own);
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
