#include "compare/report/tables_section.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <vector>

#include "compare/comparison_files.h"
#include "compare/reduced_rows.h"
#include "compare/report/plot_svg.h"

namespace graupel::compare {

namespace {

std::string cell(const MetricValues& values, const std::string& key, bool is_best = false) {
  const auto value = values.find(key);
  return (is_best ? "<td class=\"best\">" : "<td>") +
         (value == values.end() ? std::string("-") : short_number(value->second)) + "</td>";
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

/// A column's title in words: unit, and an arrow to where better is.
struct TitledMetric {
  const char *key, *title;
  int better;  ///< -1 lower, 1 higher
};
constexpr TitledMetric main_columns[] = {{"frame_ms", "a frame [ms]", -1},
                                         {"speed_ratio", "speed over mpm", 1},
                                         {"one_step_normalized", "one-step error", -1},
                                         {"position_mse_20", "position MSE, 20 frames [m\u00b2]", -1},
                                         {"position_mse_all", "position MSE [m\u00b2]", -1},
                                         {"sinkhorn", "Sinkhorn divergence [m\u00b2]", -1},
                                         {"density_error", "density error", -1},
                                         {"material_occupancy_iou", "overlap (IoU)", 1},
                                         {"clump_size_error", "clump sizes [decades]", -1},
                                         {"local_density_error", "local density", -1},
                                         {"inside_share", "inside obstacles", -1}};

/// A key that may be broken into lines at its underscores.
std::string breakable(const std::string& key) {
  std::string text;
  for (const char c : key) text += c == '_' ? std::string("_<wbr>") : std::string(1, c);
  return text;
}

/// A header cell that shows the metric's definition when pointed at.
std::string header_cell(const std::string& key, const std::string& title) {
  for (const auto* list : {&metric_list(), &material_metric_list()})
    for (const MetricInfo& metric : *list)
      if (metric.key == key)
        return fmt::format("<th title=\"{}: {}\">{}</th>", key, escape_markup(metric.meaning), title);
  return "<th>" + title + "</th>";
}

std::string main_header() {
  std::string row = "<thead><tr><th>model</th>";
  for (const TitledMetric& column : main_columns)
    row += header_cell(column.key, escape_markup(column.title) + (column.better < 0 ? " &darr;" : " &uarr;"));
  return row + "</tr></thead>\n";
}

/// Keys in which no other row is better by more than the noise floor: value within it of the best.
std::set<std::string> best_of(const MetricValues& own, const std::vector<MetricValues>& all,
                              const MetricValues& floors) {
  std::set<std::string> best;
  for (const TitledMetric& column : main_columns) {
    const auto mine = own.find(column.key);
    if (mine == own.end() || all.size() < 2) continue;
    const auto floor = floors.find(column.key);
    const double width = floor == floors.end() ? 0 : floor->second;
    const bool beaten = std::any_of(all.begin(), all.end(), [&](const MetricValues& other) {
      const auto value = other.find(column.key);
      return value != other.end() && column.better * (value->second - mine->second) > width;
    });
    if (!beaten) best.insert(column.key);
  }
  return best;
}

/// `mark` warns, `note` does not; `full` is shown when the name is pointed at.
std::string main_row(const std::string& name, const std::string& full, const MetricValues& values,
                     const std::string& mark, const char* style, const std::string& note = "",
                     const std::set<std::string>& best = {}) {
  std::string row = fmt::format("<tr{}><td title=\"{}\">{}", style, escape_markup(full), escape_markup(name));
  if (!mark.empty()) row += "<div class=\"mark\">" + escape_markup(mark) + "</div>";
  if (!note.empty()) row += "<div class=\"note\">" + escape_markup(note) + "</div>";
  row += "</td>";
  for (const TitledMetric& column : main_columns) row += cell(values, column.key, best.contains(column.key));
  return row + "</tr>\n";
}

/// Of the truth, whose errors are none.
MetricValues costs_of(MetricValues values) {
  std::erase_if(values, [](const auto& v) { return v.first != "frame_ms" && v.first != "speed_ratio"; });
  return values;
}

std::string scene_table(const Comparison& comparison, const SceneResult& scene) {
  std::string html = "<div class=\"scroll\"><table>" + main_header() + "<tbody>\n";
  const std::vector<std::string> models = models_of(comparison);
  const MetricValues floors = computed(comparison, MetricGroup::floors) ? floors_of(scene) : MetricValues{};
  std::vector<MetricValues> rivals;
  for (const ModelResult& result : scene.models)
    if (!is_truth(scene, result)) rivals.push_back(result.values);
  for (const ModelResult& result : scene.models) {
    const std::string name = short_name(result.model, models);
    if (is_truth(scene, result))
      html += main_row(name + " (the truth)", result.model, costs_of(result.values), "", " class=\"floor\"");
    else
      html += main_row(name, result.model, result.values, mark_of(scene, result), "", mark_of_ties(result),
                       best_of(result.values, rivals, floors));
  }
  if (!floors.empty()) html += main_row("noise floor (MPM against itself)", "", floors, "", " class=\"floor\"");
  return html + "</tbody></table></div>\n";
}

std::string mean_table(const Comparison& comparison) {
  std::string html = "<div class=\"scroll\"><table>" + main_header() + "<tbody>\n";
  const std::vector<std::string> models = models_of(comparison);
  for (const std::string& model : models) {
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
    html += main_row(short_name(model, models), model, mean, mark, "");
  }
  for (const std::string& model : models)
    html += main_row("geometric mean of " + short_name(model, models), model,
                     geometric_mean_over_scenes(comparison, model), "", " class=\"floor\"");
  return html + "</tbody></table></div>\n";
}

/// Geometric means of every category and of all scenes.
std::string category_table(const Comparison& comparison) {
  const std::vector<std::string> models = models_of(comparison);
  std::string html =
      "<h2>Categories</h2>\n<p class=\"soft\">Geometric means; ratios are over the opponent, of errors "
      "beyond the chaos floor.</p>\n<div class=\"scroll\"><table><thead><tr><th>category, model</th>";
  for (const Column& column : category_columns) html += header_cell(column.key, breakable(column.key));
  html += "</tr></thead><tbody>\n";
  const auto add = [&](const std::string& name, std::size_t scenes, const std::string& category, const char* style) {
    for (const std::string& model : models) {
      const MetricValues mean = geometric_mean_over_scenes(comparison, model, category);
      html += fmt::format("<tr{}><td>{}</td>", style,
                          escape_markup(fmt::format("{} ({}), {}", name, scenes, short_name(model, models))));
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
      "<h4>Reduced-order models, what they are held against, and baselines</h4>\n<div class=\"scroll\"><table><thead>"
      "<tr><th>model</th><th>kind</th>";
  for (const ReducedColumn& column : reduced_columns) html += fmt::format("<th>{}</th>", column.title);
  html += "<th>verdict</th></tr></thead><tbody>\n";
  for (const ModelResult& result : scene.models) {
    const bool baseline = result.role == ModelRole::baseline;
    html += fmt::format("<tr{}><td title=\"{}\">{}", baseline ? " class=\"floor\"" : "", escape_markup(result.model),
                        escape_markup(short_name(result.model, models_of(comparison))));
    if (!result.note.empty()) html += "<div class=\"note\">" + escape_markup(result.note) + "</div>";
    html += fmt::format("</td><td>{}</td>", name_of(result.role));
    for (const ReducedColumn& column : reduced_columns) html += "<td>" + reduced_cell(result, column) + "</td>";
    html += "<td>" + escape_markup(trust_text(result)) + "</td></tr>\n";
  }
  return html + "</tbody></table></div>\n<p class=\"soft\">" + escape_markup(reduced_legend(comparison)) + "</p>\n";
}

/// Every metric as a row, models as columns.
std::string full_table(const SceneResult& scene, const std::vector<std::string>& models) {
  std::string html = "<details><summary>All metrics</summary><div class=\"scroll\"><table><thead><tr><th>metric</th>";
  for (const ModelResult& result : scene.models)
    html += "<th>" + escape_markup(short_name(result.model, models)) + "</th>";
  html += "<th>unit</th><th class=\"text\">meaning</th></tr></thead><tbody>\n";
  for (const MetricInfo& metric : metric_list()) {
    html += "<tr><td><code>" + metric.key + "</code></td>";
    for (const ModelResult& result : scene.models) html += cell(result.values, metric.key);
    html += fmt::format("<td>{}</td><td class=\"text\">{}</td></tr>\n", escape_markup(metric.unit),
                        escape_markup(metric.meaning));
  }
  return html + "</tbody></table></div></details>\n";
}

std::string material_table(const SceneResult& scene, const std::vector<std::string>& models) {
  std::string html =
      "<details><summary>Per material</summary><div class=\"scroll\"><table><thead><tr><th>material, model</th>";
  for (const MetricInfo& metric : material_metric_list())
    html += header_cell(metric.key, breakable(metric.key) + (metric.unit.empty() ? "" : " [" + metric.unit + "]"));
  html += "</tr></thead><tbody>\n";
  for (const ModelResult& result : scene.models)
    for (const auto& [material, values] : result.materials) {
      html += "<tr><td>" + escape_markup(material + ", " + short_name(result.model, models)) + "</td>";
      for (const MetricInfo& metric : material_metric_list()) html += cell(values, metric.key);
      html += "</tr>\n";
    }
  return html + "</tbody></table></div></details>\n";
}

std::string tables_of_scene(const Comparison& comparison, const SceneResult& scene) {
  const std::vector<std::string> models = models_of(comparison);
  std::string html = "<h3>" + escape_markup(scene.name) + "</h3>\n";
  if (has_reduced_model(scene)) html += reduced_table(comparison, scene);
  html += scene_table(comparison, scene);
  const std::string mark = mark_of_references(scene);
  if (!mark.empty()) html += "<p class=\"mark\">Reference runs: " + escape_markup(mark) + "</p>\n";
  html += full_table(scene, models);
  return computed(comparison, MetricGroup::rollout) ? html + material_table(scene, models) : html;
}

}  // namespace

std::string tables_section(const Comparison& comparison) {
  std::string html =
      "<h2 id=\"tables\">Tables</h2>\n<p class=\"soft\">Arrows point to where better is; the best are "
      "bold, several where they differ by no more than the noise floor.</p>\n";
  for (const std::string& sentence : reduced_sentences(comparison)) html += "<p>" + escape_markup(sentence) + "</p>\n";
  if (!categories_of(comparison).empty() && computed(comparison, MetricGroup::rollout))
    html += category_table(comparison);
  if (comparison.scenes.size() > 1)
    html += fmt::format("<h3>Mean of {} scenes</h3>\n", comparison.scenes.size()) + mean_table(comparison);
  for (const SceneResult& scene : comparison.scenes) html += tables_of_scene(comparison, scene);
  return html;
}

}  // namespace graupel::compare
