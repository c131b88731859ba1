#include "compare/contest.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "compare/comparison_files.h"
#include "compare/deciding_metrics.h"

namespace graupel::compare {

namespace {

constexpr std::size_t lasting = 3;       // frames in a row that make a failure
constexpr double noticeable = 1.0 / 20;  // of the rival's largest error

/// A model or rival in one scene.
struct Row {
  const MetricValues* values;
  const ErrorCurves* curves;
  int64_t diverged_at_frame;
  bool is_rival, outside_training;
};

bool is_cheap(const ModelResult& result) {
  return result.role == ModelRole::baseline ||
         (result.role == ModelRole::mpm && result.model.starts_with("mpm:coarse"));
}

bool has_errors(const MetricValues& values) {
  return std::all_of(std::begin(deciding_metrics), std::end(deciding_metrics), [&](const char* key) {
    const auto value = values.find(key);
    return value != values.end() && std::isfinite(value->second);
  });
}

std::optional<Row> row_of(const SceneResult& scene, const std::string& name) {
  for (const ModelResult& result : scene.models)
    if (result.model == name && !is_truth(scene, result) && has_errors(result.values))
      return Row{&result.values, &result.curves, result.diverged_at_frame, is_cheap(result), !result.remarks.empty()};
  for (const RivalRun& rival : scene.rivals)
    if (rival.name == name && has_errors(rival.values)) {
      const auto diverged = scene.diverged_references.find(name);
      return Row{&rival.values, &rival.curves, diverged == scene.diverged_references.end() ? -1 : diverged->second,
                 true, false};
    }
  return std::nullopt;
}

using Scenes = std::vector<const SceneResult*>;

Scenes scenes_with(const Scenes& scenes, const std::string& name) {
  Scenes with;
  for (const SceneResult* scene : scenes)
    if (row_of(*scene, name)) with.push_back(scene);
  return with;
}

Scenes all_scenes(const Comparison& comparison) {
  Scenes scenes;
  for (const SceneResult& scene : comparison.scenes) scenes.push_back(&scene);
  return scenes;
}

/// Models but the truth, then the rivals that are none of them.
std::vector<std::string> names_of(const Comparison& comparison) {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models)
      if (row_of(scene, result.model)) add(result.model);
  for (const SceneResult& scene : comparison.scenes)
    for (const RivalRun& rival : scene.rivals) add(rival.name);
  return names;
}

double measured_floor(const SceneResult& scene, const std::string& key) {
  const MetricValues floors = floors_of(scene);
  const auto floor = floors.find(key);
  return floor == floors.end() ? 0 : floor->second;
}

MetricValues deciding_floors_of(const SceneResult& scene) {
  return deciding_floors(scene.models.empty() ? MetricValues{} : scene.models.front().values, scene.dx);
}

double floor_of(const SceneResult& scene, const std::string& key) {
  return deciding_floors_of(scene).at("floor_" + key);
}

/// An error below its floor counts as that.
double counted(const SceneResult& scene, const MetricValues& values, const std::string& key) {
  return std::max(values.at(key), floor_of(scene, key));
}

/// Sum over scenes and deciding metrics of the error's logarithm.
double log_errors(const Scenes& scenes, const std::string& name) {
  double sum = 0;
  for (const SceneResult* scene : scenes)
    for (const char* key : deciding_metrics) sum += std::log(counted(*scene, *row_of(*scene, name)->values, key));
  return sum;
}

/// The cheap rival with the smallest errors among those that ran in all of the scenes; empty for none.
std::string strongest_rival(const Scenes& scenes, const std::vector<std::string>& names, const std::string& but = "") {
  std::string strongest;
  double least = std::numeric_limits<double>::infinity();
  for (const std::string& name : names) {
    if (name == but || scenes.empty() || scenes_with(scenes, name).size() < scenes.size()) continue;
    if (!row_of(*scenes.front(), name)->is_rival) continue;
    if (const double errors = log_errors(scenes, name); errors < least) {
      least = errors;
      strongest = name;
    }
  }
  return strongest;
}

/// Entry k of a curve over the frames 1.., 0 beyond its end.
double at(const std::vector<double>& curve, std::size_t k) { return k < curve.size() ? curve[k] : 0; }

/// Whether the errors of frame k + 1 are beyond the rival's. Position errors are compared as distances.
bool behind(const SceneResult& scene, const Row& model, const Row& rival, std::size_t k) {
  const MetricValues least = resolution(scene.dx);
  const auto beyond = [&](const std::vector<double>& own, const std::vector<double>& other,
                          const std::vector<double>& floor, const char* key, double (*size)(double)) {
    const double largest = other.empty() ? 0 : size(*std::max_element(other.begin(), other.end()));
    return size(at(own, k)) > size(at(other, k)) + size(std::max(at(floor, k), least.at(key))) + noticeable * largest;
  };
  return beyond(model.curves->position, rival.curves->position, scene.floor_position, "position_mse_all", std::sqrt) &&
         beyond(model.curves->density, rival.curves->density, scene.floor_density, "density_error",
                [](double v) { return v; });
}

std::optional<FirstFailure> failure_in(const SceneResult& scene, const Row& model, const Row& rival) {
  std::optional<FirstFailure> failure;
  if (model.diverged_at_frame >= 0) failure = FirstFailure{scene.name, model.diverged_at_frame, true};
  std::size_t row = 0;
  const std::size_t frames = model.curves->position.size(), needed = std::min(lasting, frames);
  for (std::size_t k = 0; k < frames; ++k) {
    row = behind(scene, model, rival, k) ? row + 1 : 0;
    if (row < needed) continue;
    const auto frame = static_cast<int64_t>(k + 2 - needed);
    if (!failure || frame < failure->frame) failure = FirstFailure{scene.name, frame, false};
    break;
  }
  return failure;
}

double time_of(const Row& row) {
  const auto time = row.values->find("frame_ms");
  return time == row.values->end() ? 0 : time->second;
}

/// Geometric mean of the quotients; none where a number is 0.
struct MeanRatio {
  double logs = 0;
  std::size_t count = 0;
  bool is_known = true;
  void add(double value, double over) {
    is_known = is_known && value > 0 && over > 0;
    if (is_known) logs += std::log(value / over);
    ++count;
  }
  std::optional<double> value() const {
    if (!is_known || count == 0) return std::nullopt;
    return std::exp(logs / static_cast<double>(count));
  }
};

Outcome outcome_of(int better, int worse, int needed) {
  return better >= needed && better > worse  ? Outcome::wins
         : worse >= needed && worse > better ? Outcome::loses
                                             : Outcome::level;
}

/// A deciding metric in all scenes: better in more of them than worse, and by the mean as well, or the reverse.
MetricContest metric_contest(const Scenes& scenes, const std::string& name, const std::string& rival,
                             const std::string& key) {
  MeanRatio ratio, floor_ratio;
  int better = 0, worse = 0;
  for (const SceneResult* scene : scenes) {
    const MetricValues &own = *row_of(*scene, name)->values, &other = *row_of(*scene, rival)->values;
    const double floor = floor_of(*scene, key), difference = own.at(key) - other.at(key);
    ratio.add(counted(*scene, own, key), counted(*scene, other, key));
    floor_ratio.add(measured_floor(*scene, key), counted(*scene, other, key));
    better += difference < -floor;
    worse += difference > floor;
  }
  MetricContest contest{.ratio = ratio.value().value_or(1), .floor_ratio = floor_ratio.value().value_or(0)};
  contest.outcome = outcome_of(better, worse, 1);
  if ((contest.outcome == Outcome::wins) != (contest.ratio < 1) && contest.outcome != Outcome::level)
    contest.outcome = Outcome::level;
  return contest;
}

Contest hold(const Scenes& all, const std::string& name, const std::string& rival) {
  Contest contest;
  contest.model = name;
  contest.rival = rival;
  const Scenes scenes = scenes_with(all, name);
  contest.scenes = scenes.size();
  MeanRatio time, mpm_time;
  int timed_scenes = 0;  // a run whose first frame diverges has no time
  for (const SceneResult* scene : scenes) {
    const Row own = *row_of(*scene, name), other = *row_of(*scene, rival);
    contest.is_rival = own.is_rival;
    contest.outside_training += own.outside_training;
    if (const double frame_ms = time_of(own); frame_ms > 0)
      contest.frame_ms += (frame_ms - contest.frame_ms) / ++timed_scenes;
    time.add(time_of(own), time_of(other));
    mpm_time.add(time_of(own), scene->mpm_frame_ms);
    const auto verdict = verdicts(*own.values, *other.values, deciding_floors_of(*scene));
    contest.won += wins(verdict);
    contest.lost += loses(verdict);
    if (name == rival) continue;
    const auto failure = failure_in(*scene, own, other);
    if (failure && (!contest.failure || failure->frame < contest.failure->frame)) contest.failure = failure;
  }
  contest.time_ratio = time.value();
  contest.mpm_ratio = mpm_time.value();
  int better = 0, worse = 0;
  for (const char* key : deciding_metrics) {
    const MetricContest metric = contest.metrics[key] = metric_contest(scenes, name, rival, key);
    better += metric.outcome == Outcome::wins;
    worse += metric.outcome == Outcome::loses;
  }
  contest.outcome = outcome_of(better, worse, losing_metrics);
  return contest;
}

}  // namespace

std::vector<Contest> contests(const Comparison& comparison) {
  std::vector<Contest> results;
  if (!computed(comparison, MetricGroup::rollout)) return results;
  const Scenes all = all_scenes(comparison);
  const std::vector<std::string> names = names_of(comparison);
  for (const std::string& name : names) {
    const std::string rival = strongest_rival(scenes_with(all, name), names);
    if (!rival.empty()) results.push_back(hold(all, name, rival));
  }
  return results;
}

std::vector<Contest> decisive_contests(const Comparison& comparison) {
  const std::vector<Contest> all = contests(comparison);
  const std::vector<std::string> models = models_of(comparison);
  const auto chosen = [&](auto&& is_chosen) {
    std::vector<Contest> some;
    std::copy_if(all.begin(), all.end(), std::back_inserter(some), is_chosen);
    return some;
  };
  const auto is_model = [&](const Contest& c) {
    return std::find(models.begin(), models.end(), c.model) != models.end();
  };
  if (auto some = chosen([](const Contest& c) { return !c.is_rival; }); !some.empty()) return some;
  if (auto some = chosen([&](const Contest& c) { return is_model(c) && c.model != c.rival; }); !some.empty())
    return some;
  for (const Contest& strongest : chosen(is_model)) {
    const Scenes scenes = scenes_with(all_scenes(comparison), strongest.model);
    const std::string next = strongest_rival(scenes, names_of(comparison), strongest.model);
    if (!next.empty()) return {hold(all_scenes(comparison), strongest.model, next)};
  }
  return {};
}

const char* deciding_name(const std::string& key) {
  return key == "position_mse_all" ? "position MSE" : key == "sinkhorn" ? "Sinkhorn divergence" : "density error";
}

std::string failure_text(const Contest& contest) {
  if (!contest.failure) return "nowhere";
  return fmt::format("{}, {}frame {}", contest.failure->scene, contest.failure->diverged ? "diverged at " : "",
                     contest.failure->frame);
}

std::string floor_sentence(const Comparison& comparison) {
  return computed(comparison, MetricGroup::floors)
             ? "Differences within the noise floor, what MPM differs from itself with particles moved by 1e-4 dx or "
               "another seed, count for nobody."
             : "Noise floors were not measured (--no-floors): small differences may be chance. Those of a shift by "
               "1e-4 dx count for nobody.";
}

std::string contest_sentence(const Contest& contest, const Comparison& comparison) {
  const std::vector<std::string> models = models_of(comparison);
  std::vector<std::string> amounts, ties;
  for (const char* key : deciding_metrics) {
    const MetricContest& metric = contest.metrics.at(key);
    if (metric.outcome == Outcome::level)
      ties.push_back(deciding_name(key));
    else
      amounts.push_back(fmt::format("{} times its {}", short_number(metric.ratio), deciding_name(key)));
  }
  const char* verb = contest.outcome == Outcome::wins    ? "wins against"
                     : contest.outcome == Outcome::loses ? "loses to"
                     : amounts.empty()                   ? "ties with"
                                                         : "neither beats nor loses to";
  std::string text = fmt::format("{} {} {}, the strongest cheap rival", short_name(contest.model, models), verb,
                                 short_name(contest.rival, models));
  if (comparison.scenes.size() > 1)
    text += fmt::format(", on {} scene{} (won {}, lost {})", contest.scenes, contest.scenes == 1 ? "" : "s",
                        contest.won, contest.lost);
  if (!amounts.empty()) text += fmt::format(", with {}", fmt::join(amounts, ", "));
  if (!ties.empty()) text += fmt::format("; no clear difference in {}", fmt::join(ties, ", "));
  std::vector<std::string> times;
  if (contest.time_ratio) times.push_back(fmt::format("{} times its time", short_number(*contest.time_ratio)));
  if (contest.mpm_ratio) times.push_back(fmt::format("{} times that of mpm", short_number(*contest.mpm_ratio)));
  text += times.empty() ? ". It " : fmt::format(". It takes {} and ", fmt::join(times, ", "));
  text += !contest.failure            ? "falls behind nowhere"
          : contest.failure->diverged ? "fails first in " + failure_text(contest)
                                      : "falls behind first in " + failure_text(contest);
  if (contest.outside_training > 0)
    text += fmt::format("; {} of {} scenes {} outside its training", contest.outside_training, contest.scenes,
                        contest.outside_training == 1 ? "is" : "are");
  return text + ".";
}

}  // namespace graupel::compare
