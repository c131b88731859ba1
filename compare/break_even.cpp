#include "compare/break_even.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "compare/comparison_files.h"
#include "core/system/human_time.h"

namespace graupel::compare {

namespace {

/// Times of runs, means over the scenes of a model in which the model and both rivals predicted a frame [s]: a run that
/// diverges in its first frame has no time.
struct SceneTimes {
  std::size_t scenes = 0;
  double model = 0, mpm = 0, opponent = 0;
};

SceneTimes times_of(const Comparison& comparison, const std::string& model) {
  SceneTimes times;
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models) {
      if (result.model != model) continue;
      const auto time = result.values.find("frame_ms");
      const double frames = 1e-3 * static_cast<double>(scene.frames),
                   frame_ms = time == result.values.end() ? 0 : time->second;
      if (!(frame_ms > 0) || !(scene.mpm_frame_ms > 0) || !(scene.opponent_frame_ms > 0)) continue;
      ++times.scenes;
      times.model += frames * frame_ms;
      times.mpm += frames * scene.mpm_frame_ms;
      times.opponent += frames * scene.opponent_frame_ms;
    }
  for (double* time : {&times.model, &times.mpm, &times.opponent})
    *time /= static_cast<double>(std::max<std::size_t>(1, times.scenes));
  return times;
}

/// "never against mpm (3.20 s)".
std::string rival_words(const RivalBreakEven& rival) {
  const std::string against = fmt::format("against {} ({} s)", rival.rival, short_number(rival.rival_seconds));
  if (!rival.scenes) return (rival.verdict == BreakEvenVerdict::never ? "never " : "not known ") + against;
  return fmt::format("{} {:.0f} scene{} {}", rival.verdict == BreakEvenVerdict::pays ? "after" : "after at least",
                     *rival.scenes, *rival.scenes == 1 ? "" : "s", against);
}

/// "Data took 41.0 s, training 7.4 s; on 2 threads of AMD EPYC."
std::string offline_words(const OfflineTime& offline) {
  if (!offline.data && !offline.training) return "The weights do not say how long data and training took.";
  std::string text;
  if (offline.data && offline.training)
    text = fmt::format("Data took {}, training {}", human_time(*offline.data), human_time(*offline.training));
  else if (offline.training)
    text =
        fmt::format("Training took {}; the weights do not say how long the data took", human_time(*offline.training));
  else
    text = fmt::format("Data took {}; the weights do not say how long training took", human_time(*offline.data));
  return fmt::format("{}; on {}.", text, fmt::join(offline.devices, ", "));
}

}  // namespace

const char* name_of(BreakEvenVerdict verdict) {
  constexpr const char* names[] = {"pays", "later", "never", "unknown"};
  return names[static_cast<std::size_t>(verdict)];
}

RivalBreakEven break_even(const OfflineTime& offline, double model_seconds, const std::string& rival,
                          double rival_seconds) {
  RivalBreakEven result{.rival = rival, .rival_seconds = rival_seconds, .scenes = std::nullopt};
  if (model_seconds >= rival_seconds) {
    result.verdict = BreakEvenVerdict::never;
  } else if (offline.data || offline.training) {
    result.verdict = offline.data && offline.training ? BreakEvenVerdict::pays : BreakEvenVerdict::later;
    const double seconds = offline.data.value_or(0) + offline.training.value_or(0);
    result.scenes = std::max(1.0, std::ceil(seconds / (rival_seconds - model_seconds)));
  }
  return result;
}

std::vector<BreakEven> break_evens(const Comparison& comparison) {
  std::vector<BreakEven> results;
  if (!computed(comparison, MetricGroup::rollout)) return results;
  for (const std::string& model : models_of(comparison)) {
    const auto offline = comparison.offline.find(model);
    if (offline == comparison.offline.end()) continue;
    const SceneTimes times = times_of(comparison, model);
    if (times.scenes == 0) continue;
    BreakEven result{
        .model = model, .scenes = times.scenes, .scene_seconds = times.model, .offline = offline->second, .rivals = {}};
    result.estimate = std::any_of(result.offline.devices.begin(), result.offline.devices.end(),
                                  [&](const std::string& device) { return device != comparison.hardware; });
    result.rivals = {break_even(result.offline, times.model, comparison.scenes.front().opponent, times.opponent),
                     break_even(result.offline, times.model, "mpm", times.mpm)};
    results.push_back(std::move(result));
  }
  return results;
}

std::string break_even_sentence(const BreakEven& result, const Comparison& comparison) {
  std::vector<std::string> rivals;
  for (const RivalBreakEven& rival : result.rivals) rivals.push_back(rival_words(rival));
  const bool has_number = std::any_of(result.rivals.begin(), result.rivals.end(),
                                      [](const RivalBreakEven& rival) { return rival.scenes.has_value(); });
  return fmt::format(
      "Break-even of {} in time, errors aside: {}. A scene takes it {} s (mean of {} here, on {}). {}{}",
      short_name(result.model, models_of(comparison)), fmt::join(rivals, ", "), short_number(result.scene_seconds),
      result.scenes, comparison.hardware, offline_words(result.offline),
      result.estimate && has_number ? " That is not the hardware of the rollouts: the number of scenes is an estimate."
                                    : "");
}

}  // namespace graupel::compare
