#include "compare/comparison.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "compare/comparison_files.h"
#include "compare/deciding_metrics.h"

namespace graupel::compare {

const char* name_of(ModelRole role) {
  switch (role) {
    case ModelRole::mpm:
      return "mpm";
    case ModelRole::learned:
      return "learned";
    case ModelRole::reduced:
      return "reduced";
    case ModelRole::baseline:
      break;
  }
  return "baseline";
}

MetricValues mean_over_scenes(const Comparison& comparison, const std::string& model) {
  MetricValues sum;
  double count = 0;
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models) {
      if (result.model != model) continue;
      count += 1;
      for (const auto& [key, value] : result.values) sum[key] += value;
    }
  std::erase_if(sum, [](const auto& value) { return value.first.starts_with("ratio_"); });
  for (auto& [key, value] : sum) value /= count;
  return sum;
}

MetricValues geometric_mean_over_scenes(const Comparison& comparison, const std::string& model,
                                        const std::string& category) {
  std::map<std::string, std::vector<double>> logs;
  std::size_t scenes = 0;
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models) {
      if (result.model != model || (!category.empty() && scene.category != category)) continue;
      ++scenes;
      const MetricValues least = is_truth(scene, result) ? MetricValues{} : resolution(scene.dx);
      for (const auto& [key, value] : result.values) {
        const auto resolved = least.find(key);
        const double counted = resolved == least.end() ? value : std::max(value, resolved->second);
        if (counted > 0) logs[key].push_back(std::log(counted));
      }
    }
  MetricValues mean;
  for (const auto& [key, values] : logs)
    if (values.size() == scenes)
      mean[key] = std::exp(std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(scenes));
  return mean;
}

std::vector<std::string> categories_of(const Comparison& comparison) {
  std::vector<std::string> categories;
  for (const SceneResult& scene : comparison.scenes)
    if (!scene.category.empty() && std::find(categories.begin(), categories.end(), scene.category) == categories.end())
      categories.push_back(scene.category);
  return categories;
}

std::size_t scenes_of_category(const Comparison& comparison, const std::string& category) {
  return static_cast<std::size_t>(std::count_if(comparison.scenes.begin(), comparison.scenes.end(),
                                                [&](const SceneResult& scene) { return scene.category == category; }));
}

namespace {

bool is_baseline(const Comparison& comparison, const std::string& model) {
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models)
      if (result.model == model) return result.role == ModelRole::baseline;
  return false;
}

/// "wins in density (0.4) and loses in time (6.4)".
std::string won_and_lost(const MetricValues& ratios) {
  constexpr double equal = 0.005;  // ratios that round to 1.00
  constexpr std::pair<const char*, const char*> names[] = {{"ratio_position_mse_all", "position"},
                                                           {"ratio_sinkhorn", "Sinkhorn divergence"},
                                                           {"ratio_density_error", "density"},
                                                           {"ratio_frame_ms", "time"}};
  std::map<std::string, std::string> lists;
  for (const auto& [key, name] : names) {
    const double ratio = ratios.at(key);
    std::string& list = lists[ratio < 1 - equal ? "wins in " : ratio > 1 + equal ? "loses in " : "ties in "];
    list += (list.empty() ? "" : ", ") + std::string(name) + " (" + short_number(ratio) + ")";
  }
  std::string text;
  for (const char* verdict : {"wins in ", "ties in ", "loses in "})
    if (lists.contains(verdict)) text += (text.empty() ? "" : ", ") + (verdict + lists[verdict]);
  return text;
}

}  // namespace

std::string headline(const Comparison& comparison) {
  if (!computed(comparison, MetricGroup::ratios) || comparison.scenes.empty()) return "";
  const std::string& opponent = comparison.scenes.front().opponent;
  const std::vector<std::string> models = models_of(comparison);
  std::string text;
  for (const std::string& model : models) {
    if (model == opponent || model == "mpm" || is_baseline(comparison, model)) continue;
    const std::string missing = mark_of_missing_scenes(comparison, model);
    text += (text.empty() ? "" : "; ") + short_name(model, models) + (missing.empty() ? "" : " (" + missing + ")") +
            " " + won_and_lost(geometric_mean_over_scenes(comparison, model));
  }
  if (text.empty()) return "";
  const std::size_t n = comparison.scenes.size();
  return "Against " + opponent + " on " + std::to_string(n) + (n == 1 ? " scene, " : " scenes, ") + text + ".";
}

std::string mark_of_ties(const ModelResult& result) {
  std::string mark;
  for (const auto& [key, verdict] : result.against_opponent)
    if (verdict == "tie") mark += (mark.empty() ? "tie in " : ", ") + key;
  return mark;
}

std::vector<std::string> models_of(const Comparison& comparison) {
  std::vector<std::string> models;
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models)
      if (std::find(models.begin(), models.end(), result.model) == models.end()) models.push_back(result.model);
  return models;
}

std::string mark_of_missing_scenes(const Comparison& comparison, const std::string& model) {
  const auto has_it = [&](const SceneResult& scene) {
    return std::any_of(scene.models.begin(), scene.models.end(),
                       [&](const ModelResult& result) { return result.model == model; });
  };
  const auto all = static_cast<std::ptrdiff_t>(comparison.scenes.size()),
             there = std::count_if(comparison.scenes.begin(), comparison.scenes.end(), has_it);
  return there == all ? "" : std::to_string(there) + " of " + std::to_string(all) + " scenes";
}

bool computed(const Comparison& comparison, MetricGroup group) {
  return std::find(comparison.groups.begin(), comparison.groups.end(), group) != comparison.groups.end();
}

bool is_truth(const SceneResult& scene, const ModelResult& result) {
  return result.model == "mpm" && !scene.stored_truth;
}

MetricValues floors_of(const SceneResult& scene) {
  MetricValues floors;
  if (!scene.models.empty())
    for (const auto& [key, value] : scene.models.front().values)
      if (key.starts_with("floor_")) floors[key.substr(6)] = value;
  return floors;
}

std::string mark_of_references(const SceneResult& scene) {
  std::string mark;
  for (const auto& [reference, frame] : scene.diverged_references)
    mark += (mark.empty() ? "" : "; ") + reference + " diverged at frame " + std::to_string(frame);
  return mark;
}

std::string short_name(const std::string& model, const std::vector<std::string>& models) {
  for (std::size_t slash = model.rfind('/'); slash != std::string::npos && slash > 0;
       slash = model.rfind('/', slash - 1)) {
    std::string name = model.substr(slash + 1);
    const std::string end = "/" + name;
    const bool shared = std::any_of(models.begin(), models.end(), [&](const std::string& other) {
      return other != model && ("/" + other).ends_with(end);
    });
    if (!shared) return name;
  }
  return model;
}

std::vector<std::string> incomplete_results(const Comparison& comparison) {
  std::vector<std::string> incomplete;
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models) {
      const std::string where = " of " + result.model + " in " + scene.name;
      std::vector<MetricGroup> groups = comparison.groups;
      if (result.one_step_source.empty()) std::erase(groups, MetricGroup::one_step);
      // A run that diverged before it computed a frame has no time.
      const bool has_time = result.diverged_at_frame < 0 || result.values.count("frame_ms") > 0;
      for (const auto& key : missing_metrics(metric_list(), groups, result.values))
        if (has_time || (key != "frame_ms" && key != "speed_ratio" && key != "ratio_frame_ms"))
          incomplete.push_back(key + where);
      for (const auto& [material, values] : result.materials)
        for (const auto& key : missing_metrics(material_metric_list(), comparison.groups, values))
          incomplete.push_back(material + "." + key + where);
    }
  return incomplete;
}

}  // namespace graupel::compare
