#include "train/coarse/coarse_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "core/system/stopwatch.h"
#include "mpm/scene_variants.h"

namespace graupel::train {

namespace {

constexpr double worst = 4;
constexpr double least_gain = 0.01;      ///< of the cost, for a step that is taken
constexpr double slope_step = 0.5;       ///< of slopes, over that of offsets
constexpr double position_noise = 1e-8;  ///< [m^2], far below any error that can be seen
constexpr double density_noise = 1e-3;

double above_floor(double error, double floor) { return std::max(error - floor, floor / 10); }

double log_position(const RunErrors& run, const CoarseScene& scene) {
  return std::log((above_floor(run.position, scene.floor.position) + position_noise) /
                  (above_floor(scene.opponent.position, scene.floor.position) + position_noise));
}
double log_density(const RunErrors& run, const CoarseScene& scene) {
  return std::log((above_floor(run.density, scene.floor.density) + density_noise) /
                  (above_floor(scene.opponent.density, scene.floor.density) + density_noise));
}

/// ln of the predicted time over that of MPM on 2 dx with the step that was searched for.
double log_time(const hybrid::CoarseModel& model, const CoarseScene& scene, Device target) {
  return std::log(model.cost(scene.scene, model.resolution(scene.scene, target), target, scene.opponent_substeps));
}

/// Softer matter than the scene's, which takes fewer substeps; snow and jelly lose their shape by it.
void set_start(hybrid::CoarseModel& model) {
  const auto& rules = hybrid::constant_rules();
  for (std::size_t r = 0; r < rules.size(); ++r)
    if (rules[r].member == &MaterialConfig::bulk_modulus ||
        (rules[r].model == MaterialModel::sand && rules[r].member == &MaterialConfig::youngs_modulus))
      model.constants.offset[r] = -std::log(4.0);
}

/// Mean distance of ln substeps from those of the largest steps that were searched for on 2 dx; too few, which may blow
/// up, count three times.
double step_misfit(const hybrid::CoarseModel& model, const std::vector<CoarseScene>& scenes) {
  double sum = 0;
  for (const CoarseScene& scene : scenes) {
    const auto substeps = static_cast<double>(model.largest_step_substeps(mpm::on_coarser_grid(scene.scene, 2)));
    const double excess = std::log(substeps / static_cast<double>(scene.opponent_substeps));
    sum += excess > 0 ? excess : -3 * excess;
  }
  return sum / static_cast<double>(scenes.size());
}

/// Mean square of the same distance of the substeps that the opponent is expected to take.
double opponent_misfit(const hybrid::CoarseModel& model, const std::vector<CoarseScene>& scenes) {
  double sum = 0;
  for (const CoarseScene& scene : scenes)
    sum += std::pow(std::log(static_cast<double>(model.opponent_substeps(scene.scene)) /
                             static_cast<double>(scene.opponent_substeps)),
                    2);
  return sum / static_cast<double>(scenes.size());
}

/// Changes numbers of a model one after the other, in ever finer steps, while its misfit falls.
template <typename Misfit>
void fit_numbers(const std::vector<double*>& numbers, const Misfit& misfit) {
  double best = misfit();
  for (double change = 0.4; change > 0.02; change /= 2)
    for (int pass = 0; pass < 3; ++pass)
      for (double* const number : numbers)
        for (const double by : {change, -change}) {
          *number += by;
          const double found = misfit();
          if (found < best)
            best = found;
          else
            *number -= by;
        }
}

/// Courant numbers that give the steps which were searched for, and what the opponent's are in the mean.
void fit_steps(hybrid::CoarseModel& model, const std::vector<CoarseScene>& scenes) {
  std::vector<double*> courant = {&model.log_courant.speed}, opponent;
  for (auto& [law, number] : model.log_courant.waves) {
    courant.push_back(&number);
    opponent.push_back(&model.log_opponent[law]);
  }
  fit_numbers(courant, [&] { return step_misfit(model, scenes); });
  fit_numbers(opponent, [&] { return opponent_misfit(model, scenes); });
}

std::vector<const CoarseScene*> pointers(const std::vector<CoarseScene>& scenes) {
  std::vector<const CoarseScene*> all;
  all.reserve(scenes.size());
  for (const CoarseScene& scene : scenes) all.push_back(&scene);
  return all;
}

std::string words(const Judgement& judged) {
  return fmt::format("{:.4f} (position {:.3f}, density {:.3f}, time {:.3f})", judged.cost, judged.position,
                     judged.density, judged.time);
}

}  // namespace

double log_ratio(const RunErrors& run, const CoarseScene& scene) {
  if (run.diverged) return worst;
  return std::clamp((log_position(run, scene) + log_density(run, scene)) / 2, -worst, worst);
}

double coarse_cost(const hybrid::CoarseModel& model, const std::vector<RunErrors>& errors,
                   const std::vector<const CoarseScene*>& scenes, Device target) {
  double ratio = 0, time = 0;
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    ratio += log_ratio(errors[s], *scenes[s]);
    time += log_time(model, *scenes[s], target);
  }
  const auto n = static_cast<double>(scenes.size());
  return ratio / n + 4 * std::max(0.0, time / n);
}

CoarseTrainingResult train_coarse(const CoarseTrainingOptions& options) {
  CoarseSceneOptions scenes{.split = mpm::Split::train,
                            .count = options.scenes,
                            .seed = options.seed,
                            .frames = options.frames,
                            .target = options.target,
                            .device = options.device,
                            .message = options.message,
                            .should_stop = options.should_stop};
  const hybrid::CoarseModel start = options.from.value_or(hybrid::CoarseModel());
  scenes.resolutions = start.resolutions;
  scenes.particle_share = start.particle_share;
  const Stopwatch data_watch;
  const std::vector<CoarseScene> train = make_coarse_scenes(options.recipe, scenes);
  scenes.split = mpm::Split::valid;
  scenes.count = options.valid_scenes;
  const std::vector<CoarseScene> valid = make_coarse_scenes(options.recipe, scenes);
  if (train.empty() || valid.empty())
    throw ConfigError(fmt::format(
        "recipe '{}' gives no scenes to train on: {} of {} drawn for training and {} of {} for validation run, with "
        "neither emitters, sinks nor moving obstacles (allowed: 1 or more). Add categories such as dam_break or "
        "thrown_bodies",
        options.recipe.name, train.size(), options.scenes, valid.size(), options.valid_scenes));

  CoarseTrainingResult result;
  result.data_seconds = data_watch.seconds();
  const Stopwatch training_watch;
  result.train_scenes = train.size();
  result.valid_scenes = valid.size();
  hybrid::CoarseModel& model = result.model;
  model = start;
  if (!options.from) {
    fit_steps(model, train);
    set_start(model);
  }
  options.message(
      fmt::format("steps by Courant numbers: {:.3f} from those searched for, in ln", step_misfit(model, train)));
  model.metadata = options.provenance;
  for (const CoarseScene& scene : train) model.trained.widen(scene.scene);
  const std::vector<const CoarseScene*> judges = pointers(valid);
  const auto judged = [&](const hybrid::CoarseModel& candidate) {
    const auto errors = run_coarse_models({candidate}, judges, scenes).front();
    Judgement found{.cost = coarse_cost(candidate, errors, judges, options.target)};
    for (std::size_t s = 0; s < judges.size(); ++s) {
      found.position += errors[s].diverged ? worst : log_position(errors[s], *judges[s]);
      found.density += errors[s].diverged ? worst : log_density(errors[s], *judges[s]);
      found.time += log_time(candidate, *judges[s], options.target);
    }
    for (double* mean : {&found.position, &found.density, &found.time})
      *mean = std::exp(*mean / static_cast<double>(judges.size()));
    return found;
  };
  result.before = result.after = judged(model);
  options.improved(model);
  options.message(
      fmt::format("{} scenes, {} for validation: at the start {}", train.size(), valid.size(), words(result.before)));

  const Stopwatch watch;
  const auto out_of_time = [&] { return watch.seconds() >= 60 * options.minutes || options.should_stop(); };
  const std::vector<const CoarseScene*> teachers = pointers(train);
  const auto search = [&] {
    hybrid::CoarseModel current = model;
    double cost =
        coarse_cost(current, run_coarse_models({current}, teachers, scenes).front(), teachers, options.target);
    const std::vector<std::string>& names = hybrid::CoarseModel::parameter_names();
    double step = options.first_step;
    for (; result.sweeps < options.sweeps && !out_of_time(); ++result.sweeps, step /= 2) {
      for (std::size_t p = 0; p < names.size() && !out_of_time(); ++p) {
        std::vector<hybrid::CoarseModel> candidates(2, current);
        for (const int side : {0, 1}) {
          std::vector<double> values = current.parameters();
          values[p] += (side == 0 ? 1 : -1) * step * (names[p].ends_with("slope") ? slope_step : 1);
          candidates[static_cast<std::size_t>(side)].set_parameters(values);
        }
        const auto errors = run_coarse_models(candidates, teachers, scenes);
        for (std::size_t k = 0; k < candidates.size(); ++k) {
          const double other = coarse_cost(candidates[k], errors[k], teachers, options.target);
          if (other >= cost - least_gain) continue;
          options.message(fmt::format("{} {:+.3f}: {:.4f} to {:.4f}, {:.1f} s", names[p],
                                      candidates[k].parameters()[p] - model.parameters()[p], cost, other,
                                      watch.seconds()));
          cost = other;
          current = candidates[k];
        }
      }
      const Judgement judgement = judged(current);
      options.message(fmt::format("sweep {} with steps of {:.3f}: training {:.4f}, validation {}", result.sweeps + 1,
                                  step, cost, words(judgement)));
      if (judgement.cost >= result.after.cost) continue;
      result.after = judgement;
      model = current;
      options.improved(model);
    }
  };
  try {
    search();
  } catch (const StoppedError&) {  // within a run; the best model so far is kept
  }

  result.seconds = training_watch.seconds();
  return result;
}

}  // namespace graupel::train
