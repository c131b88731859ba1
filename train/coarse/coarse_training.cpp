#include "train/coarse/coarse_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "mpm/scene_variants.h"
#include "train/coarse/cma_es.h"

namespace graupel::train {

namespace {

constexpr double worst = 4;
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
  const double resolution = model.resolution(scene.scene, target);
  return std::log(static_cast<double>(model.scene(scene.scene, resolution).time_step.substeps_per_frame) /
                  static_cast<double>(scene.opponent_substeps)) +
         model.cost_exponent.at(target) * std::log(2 / resolution);
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
    const auto substeps = static_cast<double>(model.substeps(mpm::on_coarser_grid(scene.scene, 2)));
    const double excess = std::log(substeps / static_cast<double>(scene.opponent_substeps));
    sum += excess > 0 ? excess : -3 * excess;
  }
  return sum / static_cast<double>(scenes.size());
}

/// Courant numbers that give the steps which were searched for: one after the other, in ever finer steps.
void fit_courant_numbers(hybrid::CoarseModel& model, const std::vector<CoarseScene>& scenes) {
  std::vector<double*> numbers = {&model.log_courant.speed};
  for (auto& [law, number] : model.log_courant.waves) numbers.push_back(&number);
  double best = step_misfit(model, scenes);
  for (double change = 0.4; change > 0.02; change /= 2)
    for (int pass = 0; pass < 3; ++pass)
      for (double* const number : numbers)
        for (const double by : {change, -change}) {
          *number += by;
          const double misfit = step_misfit(model, scenes);
          if (misfit < best)
            best = misfit;
          else
            *number -= by;
        }
}

/// A first guess of how far each parameter may have to move.
std::vector<double> spreads() {
  std::vector<double> spread;
  for (const std::string& name : hybrid::CoarseModel::parameter_names())
    spread.push_back(name.ends_with("slope") || name.find("friction") != std::string::npos ? 0.1 : 0.3);
  return spread;
}

std::vector<const CoarseScene*> pointers(const std::vector<CoarseScene>& scenes) {
  std::vector<const CoarseScene*> all;
  for (const CoarseScene& scene : scenes) all.push_back(&scene);
  return all;
}

std::string words(const Judgement& judged) {
  return fmt::format("{:.4f} (position {:.3f}, density {:.3f}, time {:.3f})", judged.cost, judged.position,
                     judged.density, judged.time);
}

/// `count` of the scenes, in the order of a shuffle that every pass through them renews.
std::vector<const CoarseScene*> drawn(const std::vector<CoarseScene>& scenes, int64_t count, int64_t generation,
                                      uint64_t seed) {
  std::vector<const CoarseScene*> all = pointers(scenes);
  const auto size = static_cast<int64_t>(all.size());
  count = std::min(count, size);
  const Random random(seed, RandomPurpose::batch_order, static_cast<uint64_t>(generation));
  for (int64_t i = 0; i < count; ++i)
    std::swap(all[static_cast<std::size_t>(i)],
              all[static_cast<std::size_t>(
                  i + random.integer(static_cast<uint64_t>(i), 0, static_cast<uint32_t>(size - i)))]);
  all.resize(static_cast<std::size_t>(count));
  return all;
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
                            .message = options.message};
  const std::vector<CoarseScene> train = make_coarse_scenes(options.recipe, scenes);
  scenes.split = mpm::Split::valid;
  scenes.count = options.valid_scenes;
  const std::vector<CoarseScene> valid = make_coarse_scenes(options.recipe, scenes);
  if (train.empty() || valid.empty())
    throw ConfigError(fmt::format(
        "recipe '{}' gives no scenes to train on: {} of {} drawn for training and {} of {} for validation have neither "
        "emitters nor moving obstacles (allowed: 1 or more). Add categories such as dam_break or thrown_bodies",
        options.recipe.name, train.size(), options.scenes, valid.size(), options.valid_scenes));

  CoarseTrainingResult result;
  result.train_scenes = train.size();
  result.valid_scenes = valid.size();
  hybrid::CoarseModel& model = result.model;
  if (options.from) {
    model = *options.from;
  } else {
    fit_courant_numbers(model, train);
    set_start(model);
  }
  options.message(
      fmt::format("steps by Courant numbers: {:.3f} from those searched for, in ln", step_misfit(model, train)));
  model.metadata = options.provenance;
  for (const CoarseScene& scene : train) hybrid::widen(model.ranges, scene.scene);
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
  options.message(
      fmt::format("{} scenes, {} for validation: at the start {}", train.size(), valid.size(), words(result.before)));

  const Stopwatch watch;
  CmaEs evolution(model.parameters(), spreads(), options.candidates, options.seed);
  hybrid::CoarseModel candidate = model;
  constexpr int64_t generations_a_check = 10;
  while (result.generations < options.generations && watch.seconds() < 60 * options.minutes && !options.should_stop()) {
    std::vector<hybrid::CoarseModel> candidates;
    for (const std::vector<double>& point : evolution.sample()) {
      candidate.set_parameters(point);
      candidates.push_back(candidate);
    }
    const auto batch = drawn(train, options.scenes_a_step, result.generations, options.seed);
    const auto errors = run_coarse_models(candidates, batch, scenes);
    std::vector<double> costs;
    for (std::size_t k = 0; k < candidates.size(); ++k)
      costs.push_back(coarse_cost(candidates[k], errors[k], batch, options.target));
    evolution.update(costs);
    ++result.generations;
    if (result.generations % generations_a_check != 0) continue;
    candidate.set_parameters(evolution.mean());
    const Judgement judgement = judged(candidate);
    options.message(fmt::format("generation {}: best of {} {:.4f}; validation {}; step size {:.3f}, {:.1f} s",
                                result.generations, options.candidates, *std::min_element(costs.begin(), costs.end()),
                                words(judgement), evolution.step_size(), watch.seconds()));
    if (judgement.cost >= result.after.cost) continue;
    result.after = judgement;
    model.set_parameters(candidate.parameters());
    options.improved(model);
  }

  result.seconds = watch.seconds();
  return result;
}

}  // namespace graupel::train
