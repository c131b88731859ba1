#include "compare/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "compare/break_even.h"
#include "compare/comparison_files.h"
#include "compare/reduced_rows.h"
#include "compare/report/base64.h"
#include "compare/report/force_plots.h"
#include "compare/report/plot_svg.h"
#include "compare/report_assets.h"
#include "core/system/error.h"

namespace graupel::compare {

namespace {

using Json = nlohmann::ordered_json;

std::string cell(const MetricValues& values, const std::string& key) {
  const auto value = values.find(key);
  return "<td>" + (value == values.end() ? std::string("-") : short_number(value->second)) + "</td>";
}

/// What must not be overlooked about a result; empty for most.
std::string mark_of(const SceneResult& scene, const ModelResult& result) {
  if (result.diverged_at_frame >= 0) return fmt::format("diverged at frame {}", result.diverged_at_frame);
  const auto loses = result.values.find("loses_to_coarse");
  const bool marked = loses != result.values.end() && loses->second > 0;
  std::string mark = marked ? "loses to " + scene.opponent : "";
  const auto add = [&mark](const std::string& more) { mark += (mark.empty() || more.empty() ? "" : "; ") + more; };
  for (const std::string& remark : result.remarks) add(remark);
  return mark;
}

const char* const main_keys[] = {
    "frame_ms",    "speed_ratio",   "one_step_normalized",    "position_mse_20",  "position_mse_all",
    "sinkhorn",    "density_error", "material_occupancy_iou", "clump_size_error", "local_density_error",
    "inside_share"};

/// A key that may be broken into lines at its underscores.
std::string breakable(const std::string& key) {
  std::string text;
  for (const char c : key) text += c == '_' ? std::string("_<wbr>") : std::string(1, c);
  return text;
}

std::string main_header() {
  std::string row = "<thead><tr><th>model</th>";
  for (const char* key : main_keys) row += "<th>" + breakable(key) + "</th>";
  return row + "</tr></thead>\n";
}

/// `mark` warns, `note` does not.
std::string main_row(const std::string& name, const MetricValues& values, const std::string& mark, const char* style,
                     const std::string& note = "") {
  std::string row = fmt::format("<tr{}><td>{}", style, escape_markup(name));
  if (!mark.empty()) row += "<div class=\"mark\">" + escape_markup(mark) + "</div>";
  if (!note.empty()) row += "<div class=\"note\">" + escape_markup(note) + "</div>";
  row += "</td>";
  for (const char* key : main_keys) row += cell(values, key);
  return row + "</tr>\n";
}

std::string scene_table(const Comparison& comparison, const SceneResult& scene) {
  std::string html = "<div class=\"scroll\"><table>" + main_header() + "<tbody>\n";
  for (const ModelResult& result : scene.models)
    html += main_row(result.model, result.values, mark_of(scene, result), "", mark_of_ties(result));
  if (computed(comparison, MetricGroup::floors))
    html += main_row("chaos floor (MPM against itself)", floors_of(scene), "", " class=\"floor\"");
  return html + "</tbody></table></div>\n";
}

std::string mean_table(const Comparison& comparison) {
  std::string html = "<div class=\"scroll\"><table>" + main_header() + "<tbody>\n";
  for (const std::string& model : models_of(comparison)) {
    const MetricValues mean = mean_over_scenes(comparison, model);
    int64_t diverged = 0;
    for (const SceneResult& scene : comparison.scenes)
      for (const ModelResult& result : scene.models) diverged += result.model == model && result.diverged_at_frame >= 0;
    std::string mark = mark_of_missing_scenes(comparison, model);
    const auto add = [&mark](const std::string& more) { mark += (mark.empty() ? "" : "; ") + more; };
    if (diverged > 0) add(fmt::format("diverged in {} of {} scenes", diverged, comparison.scenes.size()));
    const auto loses = mean.find("loses_to_coarse");
    if (loses != mean.end() && loses->second > 0)
      add(fmt::format("loses to a coarse grid in {:.0f}% of the scenes", 100 * loses->second));
    html += main_row(model, mean, mark, "");
  }
  for (const std::string& model : models_of(comparison))
    html +=
        main_row("geometric mean of " + model, geometric_mean_over_scenes(comparison, model), "", " class=\"floor\"");
  return html + "</tbody></table></div>\n";
}

/// Geometric means of every category and of all scenes.
std::string category_table(const Comparison& comparison) {
  std::string html =
      "<h2>Categories</h2>\n<p class=\"soft\">Geometric means; ratios are over the opponent, of errors "
      "beyond the chaos floor.</p>\n<div class=\"scroll\"><table><thead><tr><th>category, model</th>";
  for (const Column& column : category_columns) html += "<th>" + breakable(column.key) + "</th>";
  html += "</tr></thead><tbody>\n";
  const auto add = [&](const std::string& name, std::size_t scenes, const std::string& category, const char* style) {
    for (const std::string& model : models_of(comparison)) {
      const MetricValues mean = geometric_mean_over_scenes(comparison, model, category);
      html += fmt::format("<tr{}><td>{}</td>", style, escape_markup(fmt::format("{} ({}), {}", name, scenes, model)));
      for (const Column& column : category_columns) html += cell(mean, column.key);
      html += "</tr>\n";
    }
  };
  for (const std::string& category : categories_of(comparison))
    add(category, scenes_of_category(comparison, category), category, "");
  add("all", comparison.scenes.size(), "", " class=\"floor\"");
  return html + "</tbody></table></div>\n";
}

/// Of a scene in which a reduced-order model ran.
std::string reduced_table(const Comparison& comparison, const SceneResult& scene) {
  std::string html =
      "<h3>Reduced-order models, what they are held against, and baselines</h3>\n<div class=\"scroll\"><table><thead>"
      "<tr><th>model</th><th>kind</th>";
  for (const ReducedColumn& column : reduced_columns) html += fmt::format("<th>{}</th>", column.title);
  html += "<th>verdict</th></tr></thead><tbody>\n";
  for (const ModelResult& result : scene.models) {
    const bool baseline = result.role == ModelRole::baseline;
    html += fmt::format("<tr{}><td>{}", baseline ? " class=\"floor\"" : "", escape_markup(result.model));
    if (!result.note.empty()) html += "<div class=\"note\">" + escape_markup(result.note) + "</div>";
    html += fmt::format("</td><td>{}</td>", name_of(result.role));
    for (const ReducedColumn& column : reduced_columns) html += "<td>" + reduced_cell(result, column) + "</td>";
    html += "<td>" + escape_markup(trust_text(result)) + "</td></tr>\n";
  }
  return html + "</tbody></table></div>\n<p class=\"soft\">" + escape_markup(reduced_legend(comparison)) + "</p>\n";
}

/// Every metric as a row, models as columns.
std::string full_table(const SceneResult& scene) {
  std::string html = "<details><summary>All metrics</summary><div class=\"scroll\"><table><thead><tr><th>metric</th>";
  for (const ModelResult& result : scene.models) html += "<th>" + escape_markup(result.model) + "</th>";
  html += "<th>unit</th><th class=\"text\">meaning</th></tr></thead><tbody>\n";
  for (const MetricInfo& metric : metric_list()) {
    html += "<tr><td><code>" + metric.key + "</code></td>";
    for (const ModelResult& result : scene.models) html += cell(result.values, metric.key);
    html += fmt::format("<td>{}</td><td class=\"text\">{}</td></tr>\n", escape_markup(metric.unit),
                        escape_markup(metric.meaning));
  }
  return html + "</tbody></table></div></details>\n";
}

std::string material_table(const SceneResult& scene) {
  std::string html =
      "<details><summary>Per material</summary><div class=\"scroll\"><table><thead><tr><th>material, model</th>";
  for (const MetricInfo& metric : material_metric_list()) html += "<th>" + breakable(metric.key) + "</th>";
  html += "</tr></thead><tbody>\n";
  for (const ModelResult& result : scene.models)
    for (const auto& [material, values] : result.materials) {
      html += "<tr><td>" + escape_markup(material + ", " + result.model) + "</td>";
      for (const MetricInfo& metric : material_metric_list()) html += cell(values, metric.key);
      html += "</tr>\n";
    }
  return html + "</tbody></table></div></details>\n";
}

/// A curve over the frames 1.., at most 200 points of it.
PlotLine curve_line(const std::string& label, const std::vector<double>& curve, bool dashed) {
  PlotLine line;
  line.label = label;
  line.dashed = dashed;
  const std::size_t stride = std::max<std::size_t>(1, curve.size() / 200);
  for (std::size_t k = 0; k < curve.size(); k += stride) {
    line.x.push_back(static_cast<double>(k + 1));
    line.y.push_back(curve[k]);
  }
  return line;
}

std::string scene_plots(const SceneResult& scene, const std::vector<std::string>& models) {
  Plot position{.title = "Position error",
                .x_label = "frame",
                .y_label = "root mean square [m]",
                .y_axis = Axis::logarithmic,
                .lines = {}};
  Plot density{.title = "Density error", .x_label = "frame", .y_label = "relative L1", .lines = {}};
  Plot energy{.title = "Kinetic energy", .x_label = "frame", .y_label = "J", .lines = {}};
  const auto root = [](std::vector<double> curve) {
    for (double& v : curve) v = std::sqrt(v);
    return curve;
  };
  for (const ModelResult& result : scene.models) {
    const std::string name = short_name(result.model, models);
    position.lines.push_back(curve_line(name, root(result.curves.position), false));
    density.lines.push_back(curve_line(name, result.curves.density, false));
    energy.lines.push_back(curve_line(name, result.curves.kinetic_energy, false));
  }
  if (!scene.floor_position.empty()) {
    position.lines.push_back(curve_line("floor: moved by 1e-4 dx", root(scene.floor_position), true));
    density.lines.push_back(curve_line("floor: other seed", scene.floor_density, true));
  }
  energy.lines.push_back(curve_line("truth", scene.true_energy, true));
  std::string html = "<div class=\"plots\">\n" + plot_svg(position) + plot_svg(density) + plot_svg(energy);
  for (const Plot& plot : force_plots(scene.true_forces)) html += plot_svg(plot);
  return html + "</div>\n";
}

std::string picture(const std::string& png, const std::string& description) {
  if (png.empty()) return "";
  return fmt::format("<img alt=\"{}\" src=\"data:image/png;base64,{}\">\n", escape_markup(description),
                     encode_base64(png));
}

std::string scene_pictures(const SceneResult& scene) {
  if (scene.picture.empty()) return "<p class=\"soft\">Pictures left out to keep the file small.</p>\n";
  std::string html = "<div class=\"pictures\">\n" + picture(scene.picture, scene.name + ", truth");
  for (const ModelResult& result : scene.models) html += picture(result.picture, scene.name + ", " + result.model);
  return html + "</div>\n";
}

std::string scene_section(const Comparison& comparison, const SceneResult& scene) {
  std::string html = "<h2>" + escape_markup(scene.name) + "</h2>\n";
  html += fmt::format("<p class=\"soft\">{} particles, {} frames of {:.4g} s, from <code>{}</code></p>\n",
                      scene.particles, scene.frames, scene.frame_time, escape_markup(scene.source));
  if (has_reduced_model(scene)) html += reduced_table(comparison, scene);
  html += scene_table(comparison, scene);
  const std::string mark = mark_of_references(scene);
  if (!mark.empty()) html += "<p class=\"mark\">Reference runs: " + escape_markup(mark) + "</p>\n";
  html += full_table(scene);
  if (!computed(comparison, MetricGroup::rollout)) return html;
  return html + material_table(scene) + scene_plots(scene, models_of(comparison)) + scene_pictures(scene);
}

template <typename T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string data_block(const std::string& id, std::string_view bytes) {
  return "<script type=\"text/plain\" id=\"" + id + "\">" + encode_base64(bytes) + "</script>\n";
}

Json vector_json(const Vec3d& v) { return {v[0], v[1], v[2]}; }

/// Index of the player's data as JSON, and the data blocks.
std::string player_data(const Comparison& comparison) {
  Json scenes = Json::array();
  std::string blocks;
  int number = 0;
  const auto add_track = [&](const PlayerTrack& track) {
    const std::string id = fmt::format("d{}", number++);
    blocks += data_block(id + "p", bytes_of(track.position)) + data_block(id + "t", bytes_of(track.type));
    return Json{{"id", id},
                {"label", track.label},
                {"particles", track.particles},
                {"allParticles", track.all_particles},
                {"frames", track.frames},
                {"radius", track.radius}};
  };
  for (const SceneResult& scene : comparison.scenes) {
    Json tracks = Json::array({add_track(scene.truth)});
    for (const ModelResult& result : scene.models) tracks.push_back(add_track(result.track));
    const std::string id = fmt::format("d{}", number++);
    blocks += data_block(id + "p", bytes_of(scene.obstacles.position));
    blocks += data_block(id + "n", bytes_of(scene.obstacles.normal));
    scenes.push_back(
        {{"name", scene.name},
         {"low", vector_json(scene.low)},
         {"size", vector_json(scene.size)},
         {"up", vector_json(scene.up)},
         {"frames", scene.frames},
         {"frameTime", scene.frame_time},
         {"obstacles",
          {{"id", id}, {"points", scene.obstacles.position.size() / 3}, {"radius", scene.obstacles.radius}}},
         {"tracks", tracks}});
  }
  std::string text = Json{{"scenes", scenes}}.dump();
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  return "<script type=\"application/json\" id=\"player-index\">" + text + "</script>\n" + blocks;
}

std::string player_section(const Comparison& comparison) {
  return R"(<h2>Particles in motion</h2>
<div id="player">
<div class="bar"><label>Scene <select id="player-scene"></select></label>
<label>Model on the right <select id="player-model"></select></label>
<button id="player-play">Play</button>
<input type="range" id="player-scrub" min="0" max="1" step="0.25" value="0" aria-label="frame">
<span id="player-time"></span></div>
<div class="sides"><span>truth</span><span id="player-right"></span></div>
<canvas id="player-canvas"></canvas>
<p class="soft" id="player-message">Drag to orbit, wheel to zoom.</p>
<p class="soft" id="player-note"></p>
</div>
)" + player_data(comparison) +
         "<script>\n" + player_script + "</script>\n";
}

std::string head_section(const Comparison& comparison) {
  const std::string sentence = headline(comparison);
  std::string sentences = sentence.empty() ? "" : "<p><strong>" + escape_markup(sentence) + "</strong></p>\n";
  for (const std::string& reduced : reduced_sentences(comparison))
    sentences += "<p><strong>" + escape_markup(reduced) + "</strong></p>\n";
  for (const BreakEven& result : break_evens(comparison))
    sentences += "<p>" + escape_markup(break_even_sentence(result, comparison)) + "</p>\n";
  return fmt::format(
      "<h1>Graupel: learned simulators against MPM</h1>\n{}"
      "<p class=\"soft\">{} &middot; {} &middot; {} threads</p>\n<p>Made by</p>\n<pre>{}</pre>\n"
      "<p>Errors count predicted frames only, against the truth named with each scene. "
      "<code>mpm</code> is the solver at the scene's own step, <code>mpm:fast</code> at the largest stable step "
      "(searched for each scene; <code>substeps_per_frame</code> and <code>step_search_s</code> tell), "
      "<code>mpm:coarse</code> on a grid twice as coarse with an eighth of the particles, "
      "<code>mpm:coarse:fast</code> that at its largest stable step, <code>mpm:fine</code> on a grid half as coarse "
      "with eight times the particles. A model loses that is worse than the coarse grid in two of position MSE, "
      "Sinkhorn divergence and density error; differences within the chaos floor are ties. The chaos floor is what MPM "
      "differs from itself when its particles are moved by 1e-4 dx (position errors) or sampled with another seed (the "
      "rest): errors near it cannot be told from chaos. Definitions: <code>docs/reference/metrics.md</code>.</p>\n",
      sentences, escape_markup(comparison.version), escape_markup(comparison.machine), comparison.threads,
      escape_markup(comparison.command));
}

std::string build(const Comparison& comparison) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n"
      "<title>Graupel comparison</title>\n<style>\n" +
      std::string(report_style) + "</style>\n</head>\n<body>\n" + head_section(comparison);
  if (!categories_of(comparison).empty() && computed(comparison, MetricGroup::rollout))
    html += category_table(comparison);
  if (comparison.scenes.size() > 1)
    html += fmt::format("<h2>Mean of {} scenes</h2>\n", comparison.scenes.size()) + mean_table(comparison);
  if (computed(comparison, MetricGroup::rollout) && !comparison.scenes.empty()) html += player_section(comparison);
  for (const SceneResult& scene : comparison.scenes) html += scene_section(comparison, scene);
  return html + "</body>\n</html>\n";
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
