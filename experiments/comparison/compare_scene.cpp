#include "experiments/comparison/compare_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compare/metrics/containment.h"
#include "compare/metrics/one_step_error.h"
#include "compare/metrics/position_error.h"
#include "compare/pictures/png.h"
#include "compare/pictures/raster.h"
#include "core/scene/kinematic_particles.h"
#include "core/scene/particle_rows.h"
#include "core/system/error.h"
#include "experiments/comparison/fairness.h"
#include "experiments/comparison/stored_truth.h"
#include "experiments/models/trained_materials.h"
#include "experiments/process/process.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/features/periodic_images.h"
#include "mpm/scene/particle_materials.h"
#include "mpm/scene/scene_hash.h"

namespace graupel::experiments {

namespace {

constexpr std::size_t history_of_one_step = 5;  ///< frames before the first one-step error
constexpr std::size_t obstacle_points = 12000;  ///< in the report's player

/// The scene without its moving obstacles, of which pictures and one-step errors know nothing.
Scene fixed_part(Scene scene) {
  std::erase_if(scene.obstacles, [](const Obstacle& obstacle) { return obstacle.motion.has_value(); });
  return scene;
}

}  // namespace

SceneComparison::SceneComparison(const CompareOptions& options, const SceneTask& task, Device device,
                                 const compare::ReportBudget& budget, const TrainingRuns* training_runs)
    : options_(options),
      task_(task),
      device_(device),
      budget_(budget),
      training_runs_(training_runs),
      obstacles_(fixed_part(task.scene)),
      all_obstacles_(task.scene.has_moving_obstacles() ? sparsegrid::ObstacleSet(task.scene) : obstacles_) {
  result_.name = task.scene.name;
  result_.source = task.source;
  result_.category = task.category;
  result_.frames = static_cast<std::size_t>(task.frames);
  result_.frame_time = task.scene.frame_time;
  result_.dx = task.scene.domain.dx;
  result_.low = task.scene.domain.origin;
  result_.size = task.scene.domain.size;
  result_.up = compare::up_axis(task.scene);
  result_.true_forces = task.forces;
  result_.stored_truth = task.stored.has_value();
}

TimedRun SceneComparison::run_variant(const mpm::SolverVariant& variant) {
  return run_mpm(task_.scene, {.variant = variant,
                               .device = device_,
                               .seed = task_.seed,
                               .frames = task_.frames,
                               .label = label(mpm::variant_word(variant)),
                               .tracers = judged_by_tracers(variant) ? &start_ : nullptr,
                               .contact_forces = options_.forces,
                               .must_finish = variant == mpm::same_solver && !task_.stored});
}

void SceneComparison::make_truth() {
  if (task_.stored) {
    truth_.run.trajectory = *task_.stored;
    attach_masses(task_, truth_.run);
    start_ = start_of_stored(task_, truth_.run);
    if (!options_.one_step_only) {
      rerun_ = run_variant(mpm::same_solver);
      truth_.cost = rerun_->cost;
    }
  } else {
    truth_ = run_variant(mpm::same_solver);
    result_.true_forces = truth_.forces;
    start_ = start_of(task_.scene, task_.seed);
  }
  result_.particles = truth_.run.size();
}

void SceneComparison::note_divergence(const std::string& reference, const TimedRun& run) {
  const int64_t frame = run.run.trajectory.diverged_at_frame;
  if (frame >= 0) result_.diverged_references[reference] = frame;
}

SceneFloors SceneComparison::measure_floors() {
  MpmRunOptions run{.device = device_,
                    .seed = task_.seed,
                    .frames = task_.frames,
                    .label = label("moved particles"),
                    .displacement = floor_displacement * task_.scene.domain.dx};
  const TimedRun moved = run_mpm(task_.scene, run);
  const auto position = evaluate_rollout(task_.scene, all_obstacles_, truth_.run, moved.run);
  run.label = label("another seed");
  run.displacement = 0;
  run.seed = reseeded(task_.seed);
  const TimedRun other_seed = run_mpm(task_.scene, run);
  const auto distribution = evaluate_rollout(task_.scene, all_obstacles_, truth_.run, other_seed.run);
  SceneFloors floors{.scene_hash = mpm::rounded_scene_hash(task_.scene, task_.seed),
                     .frames = task_.frames,
                     .values = compare::floor_values(position, distribution),
                     .position = position.curves.position,
                     .density = distribution.curves.density,
                     .diverged = {}};
  const auto note = [&](const char* name, const TimedRun& timed) {
    const int64_t frame = timed.run.trajectory.diverged_at_frame;
    if (frame >= 0) floors.diverged[name] = frame;
  };
  note("moved", moved);
  note("reseeded", other_seed);
  return floors;
}

void SceneComparison::add_rival(const std::string& name, const TimedRun& run, double frame_ms) {
  compare::Evaluation evaluation = evaluate_rollout(task_.scene, all_obstacles_, truth_.run, run.run);
  evaluation.values["frame_ms"] = frame_ms;
  result_.rivals.push_back({name, std::move(evaluation.values), std::move(evaluation.curves)});
}

void SceneComparison::make_references(const mpm::SolverVariant& opponent) {
  const compare::Evaluation self = evaluate_rollout(task_.scene, all_obstacles_, truth_.run, truth_.run);
  result_.true_energy = self.curves.kinetic_energy;
  opponent_ = opponent;
  result_.opponent = mpm::variant_word(opponent);
  opponent_run_ = run_variant(opponent);
  note_divergence(result_.opponent, *opponent_run_);
  result_.opponent_frame_ms = 1e3 * opponent_run_->cost.frame;
  add_rival(result_.opponent, *opponent_run_, result_.opponent_frame_ms);
  opponent_values_ = result_.rivals.back().values;
  const BaselineRun still = baseline_runs(nullptr, task_, truth_.run).front();
  add_rival(still.name, still.timed, 0);
  result_.mpm_frame_ms = 1e3 * truth_.cost.frame;
  if (options_.floors) {
    floors_ = options_.floor_file.empty() ? measure_floors()
                                          : FloorFile(options_.floor_file).of(task_.scene, task_.seed, task_.frames);
    result_.floor_position = floors_.position;
    result_.floor_density = floors_.density;
    result_.diverged_references.insert(floors_.diverged.begin(), floors_.diverged.end());
  }
  if (options_.report.empty() && options_.pictures.empty()) return;
  const double height = std::sqrt(static_cast<double>(budget_.picture_pixels) * 3 / 4);
  backdrop_ =
      compare::make_backdrop(task_.scene, obstacles_, static_cast<int>(height * 4 / 3), static_cast<int>(height));
  const auto frames = compare::picture_frames(truth_.run.predicted());
  result_.picture = compare::encode_png(compare::picture_row(*backdrop_, truth_.run, frames, "truth"));
  const auto thinning = compare::choose_thinning(truth_.run.size(), truth_.run.predicted(), budget_.track_bytes);
  result_.truth = compare::make_track(task_.scene, truth_.run, "truth", thinning);
  result_.obstacles = compare::make_player_obstacles(task_.scene, obstacles_, obstacle_points);
}

std::vector<std::size_t> SceneComparison::one_step_frames() const {
  const std::size_t last = truth_.run.predicted();
  const std::size_t first = last > history_of_one_step ? history_of_one_step : 0;
  std::vector<std::size_t> frames;
  for (std::size_t n = first; n < last; n += static_cast<std::size_t>(options_.one_step_stride)) frames.push_back(n);
  return frames;
}

/// Positions of the truth; before frame 0 its ballistic past.
std::vector<Vec3f> SceneComparison::true_position(int64_t frame) const {
  if (frame >= 0) return truth_.run.position(static_cast<std::size_t>(frame));
  return past_of(start_, task_.scene, static_cast<int>(1 - frame)).front();
}

const graph::Environment& SceneComparison::environment() {
  if (!environment_) environment_.emplace(task_.scene);
  return *environment_;
}

/// Numbers of the particles that are in the run in the frames n and n + 1.
std::vector<std::size_t> SceneComparison::active_between(std::size_t n) const {
  std::vector<std::size_t> active;
  const ParticleFrame &current = truth_.run.trajectory.frames[n], &next = truth_.run.trajectory.frames[n + 1];
  for (std::size_t i = 0; i < truth_.run.size(); ++i)
    if (current.is_active(i) && next.is_active(i)) active.push_back(i);
  return active;
}

compare::OneStepError SceneComparison::one_step_of_network(const ComparedModel& model) {
  const graph::LearnedSimulator& network = *model.network;
  const double dt = task_.scene.frame_time;
  graph::MovingEnvironment moving_environment(environment());
  const graph::ParticleSchedule schedule = schedule_of(start_);
  const auto accelerations = [&](const graph::Environment& here, const std::vector<int32_t>& type,
                                 const std::vector<int32_t>& material,
                                 const std::vector<std::vector<Vec3f>>& positions) {
    if (model.choice.parts == NetworkParts::corrections_alone)
      return std::vector<Vec3f>(positions.back().size(), (task_.scene.gravity * std::pow(dt, 2)).cast<float>());
    return device_ == Device::cuda ? network.one_step_on_gpu(task_.scene, here, type, positions, material)
                                   : network.one_step(here, type, positions, nullptr, material);
  };
  compare::OneStepAccumulator error(task_.scene.gravity, dt, task_.scene.domain.dx);
  const int64_t history = network.config().history;
  for (const std::size_t frame : one_step_frames()) {
    const auto n = static_cast<int64_t>(frame);
    const graph::Environment& here = moving_environment.at(static_cast<double>(n + 1) * dt);
    std::vector<std::vector<Vec3f>> positions;
    for (int64_t f = n - history; f <= n; ++f) positions.push_back(true_position(f));
    graph::add_past_of_born(task_.scene, schedule, static_cast<double>(n) * dt, positions);
    graph::unwrap_periodic(here, positions);
    std::vector<std::vector<Vec3f>> next = {true_position(n + 1), positions.back()};
    graph::unwrap_periodic(here, next);
    const std::vector<std::size_t> active = active_between(frame);
    for (std::vector<Vec3f>& all : positions) all = particle_rows(all, active);
    const std::vector<int32_t> type = particle_rows(start_.particle_type, active),
                               material = particle_rows(start_.material, active);
    std::vector<Vec3d> predicted;
    for (const Vec3f& a : accelerations(here, type, material, positions)) predicted.push_back(a.cast<double>());
    error.add(predicted,
              compare::frame_accelerations(positions[positions.size() - 2], positions.back(),
                                           particle_rows(next.front(), active)),
              compare::clearances(task_.scene, obstacles_, positions.back()),
              particle_rows(kinematic_at(start_, static_cast<double>(n + 1) * dt), active));
  }
  return error.result();
}

compare::OneStepError SceneComparison::one_step_of_rollout(const compare::ParticleRun& run) const {
  compare::OneStepAccumulator error(task_.scene.gravity, task_.scene.frame_time, task_.scene.domain.dx);
  const auto position = [&](int64_t f) {
    std::vector<Vec3d> x;
    for (const Vec3f& p : f < 0 ? true_position(f) : run.position(static_cast<std::size_t>(f)))
      x.push_back(p.cast<double>());
    return x;
  };
  for (const std::size_t frame : one_step_frames()) {
    const auto n = static_cast<int64_t>(frame);
    std::vector<Vec3d> predicted = position(n + 1);
    const auto current = position(n), before = position(n - 1);
    for (std::size_t i = 0; i < predicted.size(); ++i) predicted[i] += before[i] - 2.0 * current[i];
    error.add(predicted, compare::frame_accelerations(true_position(n - 1), true_position(n), true_position(n + 1)),
              compare::clearances(task_.scene, obstacles_, true_position(n)), kinematic_mask(start_.particle_type));
  }
  return error.result();
}

const TimedRun& SceneComparison::run_of(const ComparedModel& model, TimedRun& own) {
  const ModelChoice& choice = model.choice;
  switch (choice.kind) {
    case ModelKind::network:
      return own = run_network(*model.network, task_.scene, environment(), start_, task_.frames, device_,
                               label(choice.label),
                               laws_of(choice.parts, {options_.density_limit, options_.free_flight}));
    case ModelKind::reduced:
      return own = run_reduced(*model.reduced, task_.scene, task_.seed, task_.frames, device_, choice.pull,
                               label(choice.label));
    case ModelKind::coarse:
      return own = run_coarse_model(*model.coarse, task_.scene,
                                    {.device = device_,
                                     .seed = task_.seed,
                                     .frames = task_.frames,
                                     .label = label(choice.label),
                                     .tracers = &start_,
                                     .contact_forces = options_.forces});
    case ModelKind::mpm:
      break;
  }
  if (opponent_run_ && choice.variant == opponent_) return *opponent_run_;
  if (!(choice.variant == mpm::same_solver)) return own = run_variant(choice.variant);
  return rerun_ ? *rerun_ : truth_;
}

void SceneComparison::add_remarks(const ComparedModel& model, compare::ModelResult& result) {
  std::vector<std::string> lines;
  if (model.network && model.choice.parts != NetworkParts::corrections_alone)
    lines = training_remarks(model.network->weights(), task_.scene);
  if (model.reduced) lines = unlike_training(*model.reduced, task_.scene);
  if (model.coarse)
    for (const std::string& line : model.coarse->unlike_training(task_.scene))
      lines.push_back("outside the training: " + line);
  for (const std::string& line : lines) warn(fmt::format("{}: '{}' {}", task_.scene.name, model.choice.name, line));
  result.remarks = std::move(lines);
}

void SceneComparison::judge(const TimedRun& timed, const compare::RunCost& cost, const std::string& name,
                            compare::ModelResult& result) {
  auto evaluation = evaluate_rollout(task_.scene, all_obstacles_, truth_.run, timed.run);
  if (!compare::same_particles(truth_.run, timed.run))
    throw InputError("'" + result.model + "' moves other particles than the truth of '" + task_.scene.name +
                     "'. Use the scene and the seed that it was trained with");
  result.values = std::move(evaluation.values);
  result.materials = std::move(evaluation.materials);
  result.curves = std::move(evaluation.curves);
  result.diverged_at_frame = timed.run.trajectory.diverged_at_frame;
  result.trust = timed.trust;
  result.forces = timed.forces;
  result.values.merge(compare::cost_values(cost, timed.moved, truth_.cost.frame));
  result.values.insert(floors_.values.begin(), floors_.values.end());
  const compare::MetricValues floors = compare::deciding_floors(floors_.values, task_.scene.domain.dx);
  if (options_.floors) result.values.merge(ratios(result.values, opponent_values_, floors));
  const bool is_opponent = opponent_run_ && &timed == &*opponent_run_;
  if (!is_opponent) result.against_opponent = compare::verdicts(result.values, opponent_values_, floors);
  result.values["loses_to_coarse"] = compare::loses(result.against_opponent) ? 1 : 0;
  if (!backdrop_) return;
  const auto frames = compare::picture_frames(truth_.run.predicted());
  result.picture = compare::encode_png(compare::picture_row(*backdrop_, timed.run, frames, name));
  const auto thinning = compare::choose_thinning(timed.run.size(), timed.run.predicted(), budget_.track_bytes);
  result.track = compare::make_track(task_.scene, timed.run, name, thinning);
}

compare::ModelResult SceneComparison::evaluate(const ComparedModel& model) {
  compare::ModelResult result;
  result.model = model.choice.name;
  result.role = role_of(model.choice.kind);
  if (model.reduced && model.choice.pull == Pull::as_trained) result.manifold_pull = model.reduced->model.manifold_pull;
  if (has_one_step_error(model.choice.kind)) result.one_step_source = model.network ? "true history" : "own rollout";
  if (task_.stored && model.network && model.network->config().material_constants)
    start_.material =
        mpm::network_materials(task_.scene, *task_.stored, truth_.run.position(0), "'" + task_.source + "'");
  add_remarks(model, result);
  if (options_.one_step_only) {
    if (model.network) result.values = compare::one_step_values(one_step_of_network(model));
    return result;
  }
  TimedRun own;  // of the models that are not run already
  const TimedRun& timed = run_of(model, own);
  judge(timed, cost_with_weights(timed, model.choice.weights), model.choice.label, result);
  if (has_one_step_error(model.choice.kind))
    result.values.merge(
        compare::one_step_values(model.network ? one_step_of_network(model) : one_step_of_rollout(timed.run)));
  return result;
}

void SceneComparison::add_baselines() {
  for (const BaselineRun& baseline : baseline_runs(training_runs_, task_, truth_.run)) {
    compare::ModelResult result;
    result.model = baseline.name;
    result.role = compare::ModelRole::baseline;
    result.note = baseline.note;
    judge(baseline.timed, cost_with_weights(baseline.timed, ""), baseline.name, result);
    result_.models.push_back(std::move(result));
  }
}

compare::SceneResult SceneComparison::run(const std::vector<ComparedModel>& models) {
  make_truth();
  std::vector<ModelChoice> choices;
  choices.reserve(models.size());
  for (const ComparedModel& model : models) choices.push_back(model.choice);
  if (!options_.one_step_only) make_references(opponent_of(choices));
  for (const ComparedModel& model : models) result_.models.push_back(evaluate(model));
  if (std::any_of(models.begin(), models.end(), [](const ComparedModel& model) { return model.reduced != nullptr; }))
    add_baselines();
  return std::move(result_);
}

}  // namespace graupel::experiments
