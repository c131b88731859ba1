#include "compare/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "compare/break_even.h"
#include "compare/report/player_section.h"
#include "compare/report/plot_svg.h"
#include "compare/report/scene_figures.h"
#include "compare/report/summary_section.h"
#include "compare/report/tables_section.h"
#include "compare/report_assets.h"
#include "core/system/error.h"

namespace graupel::compare {

namespace {

std::string head_section(const Comparison& comparison) {
  const std::size_t scenes = comparison.scenes.size();
  return fmt::format(
      "<h1>Graupel comparison</h1>\n<p class=\"soft\">{} scene{} &middot; {} &middot; {} &middot; {} thread{} &middot; "
      "<a href=\"#scenes\">pictures</a> <a href=\"#tables\">tables</a> <a href=\"#made\">how it was made</a></p>\n",
      scenes, scenes == 1 ? "" : "s", escape_markup(comparison.version), escape_markup(comparison.machine),
      comparison.threads, comparison.threads == 1 ? "" : "s");
}

std::string scene_section(const Comparison& comparison, const SceneResult& scene) {
  const std::vector<std::string> models = models_of(comparison);
  return fmt::format("<h2>{}</h2>\n<p class=\"soft\">{} particles, {} frames of {:.4g} s, from <code>{}</code>{}</p>\n",
                     escape_markup(scene.name), scene.particles, scene.frames, scene.frame_time,
                     escape_markup(scene.source), scene.stored_truth ? ", whose frames are the truth" : "") +
         scene_pictures(scene, models) + scene_plots(scene, models);
}

/// What the names of those models mean that are there, and the rules.
std::string meanings(const Comparison& comparison) {
  constexpr std::pair<const char*, const char*> names[] = {
      {"mpm", "is the solver at the scene's own step"},
      {"mpm:fast",
       "runs at the largest stable step (searched for each scene; <code>substeps_per_frame</code> and "
       "<code>step_search_s</code> tell)"},
      {"mpm:coarse", "runs on a grid twice as coarse with an eighth of the particles"},
      {"mpm:coarse:fast", "runs on that grid at its largest stable step"},
      {"mpm:fine", "runs on a grid half as coarse with eight times the particles"}};
  const std::vector<std::string> models = models_of(comparison);
  const auto is_there = [&](const std::string& name) {
    return name == "mpm" || std::find(models.begin(), models.end(), name) != models.end() ||
           std::any_of(comparison.scenes.begin(), comparison.scenes.end(),
                       [&](const SceneResult& scene) { return scene.opponent == name; });
  };
  std::string html = "<p>Errors count predicted frames only, against the truth of each scene.";
  for (const auto& [name, meaning] : names)
    if (is_there(name)) html += fmt::format(" <code>{}</code> {}.", name, meaning);
  html +=
      " A model wins against its rival, or loses to it, that is better, or worse, in two of position MSE, Sinkhorn "
      "divergence and density error, whatever the time.";
  if (computed(comparison, MetricGroup::floors))
    html +=
        " The noise floor is what MPM differs from itself when its particles are moved by 1e-4 dx (position errors) "
        "or sampled with another seed (the rest): errors near it cannot be told from chaos.";
  return html + "</p>\n";
}

std::string closing_section(const Comparison& comparison) {
  std::string html;
  const std::vector<BreakEven> paying = break_evens(comparison);
  if (!paying.empty()) html += "<h2>When a model pays</h2>\n";
  for (const BreakEven& result : paying)
    html += "<p>" + escape_markup(break_even_sentence(result, comparison)) + "</p>\n";
  return html + "<h2 id=\"made\">How it was made</h2>\n<pre>" + escape_markup(comparison.command) + "</pre>\n" +
         meanings(comparison);
}

std::string build(const Comparison& comparison) {
  const bool has_rollouts = computed(comparison, MetricGroup::rollout) && !comparison.scenes.empty();
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n"
      "<title>Graupel comparison</title>\n<style>\n" +
      std::string(report_style) + "</style>\n</head>\n<body>\n" + head_section(comparison) +
      summary_section(comparison) + "<div id=\"scenes\"></div>\n";
  if (has_rollouts) {
    for (const SceneResult& scene : comparison.scenes) html += scene_section(comparison, scene);
    html += player_section(comparison);
  }
  return html + tables_section(comparison) + closing_section(comparison) + "</body>\n</html>\n";
}

bool halve_all_frames(Comparison& comparison) {
  bool changed = false;
  for (SceneResult& scene : comparison.scenes) {
    changed |= halve_frames(scene.truth);
    for (ModelResult& result : scene.models) changed |= halve_frames(result.track);
  }
  return changed;
}

/// Leaves out the pictures of the last scene that has some.
bool drop_pictures(Comparison& comparison) {
  for (auto scene = comparison.scenes.rbegin(); scene != comparison.scenes.rend(); ++scene) {
    if (scene->picture.empty()) continue;
    scene->picture.clear();
    for (ModelResult& result : scene->models) result.picture.clear();
    return true;
  }
  return false;
}

}  // namespace

std::string report_html(Comparison comparison, std::size_t limit) {
  for (int halvings = 0;;) {
    std::string html = build(comparison);
    if (html.size() <= limit) return html;
    if (halvings++ < 3 && halve_all_frames(comparison)) continue;
    if (drop_pictures(comparison) || halve_all_frames(comparison)) continue;
    throw ConfigError(fmt::format(
        "the report does not fit ({} bytes without pictures, at most {}). Compare fewer scenes", html.size(), limit));
  }
}

ReportBudget report_budget(std::size_t rows) {
  rows = std::max<std::size_t>(1, rows);
  // 11 MB of player data and 8 MB of pictures before base64 makes them a third larger; a pixel takes about 0.6 bytes.
  const std::size_t track = std::min<std::size_t>(std::size_t(1) << 20, 9000000 / rows);
  const std::size_t pixels = std::clamp<std::size_t>(6500000 / rows * 10 / 6 / 4, 120 * 90, 400 * 300);
  return {pixels, track};
}

}  // namespace graupel::compare
