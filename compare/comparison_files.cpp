#include "compare/comparison_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "compare/break_even.h"
#include "compare/contest.h"
#include "compare/reduced_rows.h"

namespace graupel::compare {

using Json = nlohmann::ordered_json;

namespace {

/// Metrics in the order of the list.
Json values_json(const std::vector<MetricInfo>& list, const MetricValues& values) {
  Json json = Json::object();
  for (const MetricInfo& metric : list)
    if (const auto value = values.find(metric.key); value != values.end()) json[metric.key] = value->second;
  return json;
}

Json model_json(const SceneResult& scene, const ModelResult& result) {
  Json json = {{"scene", scene.name}, {"model", result.model}, {"role", name_of(result.role)}};
  if (!result.note.empty()) json["note"] = result.note;
  if (result.trust)
    json["trust"] = {{"verdict", result.trust->verdict},
                     {"number", result.trust->number},
                     {"training_error", result.trust->training_error},
                     {"error_bound", result.trust->bound ? Json(*result.trust->bound) : Json()}};
  if (result.manifold_pull > 0) json["manifold_pull"] = result.manifold_pull;
  json["one_step_source"] = result.one_step_source.empty() ? "none" : result.one_step_source;
  if (result.diverged_at_frame >= 0) json["diverged_at_frame"] = result.diverged_at_frame;
  if (!result.remarks.empty()) json["remarks"] = result.remarks;
  if (!result.against_opponent.empty()) json["against_opponent"] = result.against_opponent;
  json.update(values_json(metric_list(), result.values));
  json["materials"] = Json::object();
  for (const auto& [material, values] : result.materials)
    json["materials"][material] = values_json(material_metric_list(), values);
  json["curves"] = {{"position_error", result.curves.position},
                    {"density_error", result.curves.density},
                    {"kinetic_energy", result.curves.kinetic_energy}};
  return json;
}

/// null for what is not known.
Json number_or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

Json break_even_json(const BreakEven& result, const Comparison& comparison) {
  Json json = {{"model", result.model},
               {"scenes", result.scenes},
               {"scene_s", result.scene_seconds},
               {"data_s", number_or_null(result.offline.data)},
               {"training_s", number_or_null(result.offline.training)},
               {"made_on", result.offline.devices},
               {"run_on", comparison.hardware},
               {"estimate", result.estimate}};
  json["rivals"] = Json::array();
  for (const RivalBreakEven& rival : result.rivals)
    json["rivals"].push_back({{"rival", rival.rival},
                              {"scene_s", rival.rival_seconds},
                              {"verdict", name_of(rival.verdict)},
                              {"scenes", number_or_null(rival.scenes)}});
  json["sentence"] = break_even_sentence(result, comparison);
  return json;
}

Json contest_json(const Contest& contest, const Comparison& comparison) {
  constexpr const char* outcomes[] = {"wins", "level", "loses"};
  const auto word = [&](Outcome outcome) { return outcomes[static_cast<std::size_t>(outcome)]; };
  Json json = {{"model", contest.model},   {"rival", contest.rival}, {"outcome", word(contest.outcome)},
               {"scenes", contest.scenes}, {"won", contest.won},     {"lost", contest.lost}};
  for (const auto& [key, metric] : contest.metrics)
    json["ratios"][key] = {{"outcome", word(metric.outcome)}, {"ratio", metric.ratio}};
  json["time_ratio"] = number_or_null(contest.time_ratio);
  json["falls_behind"] = Json();
  if (contest.failure)
    json["falls_behind"] = {
        {"scene", contest.failure->scene}, {"frame", contest.failure->frame}, {"diverged", contest.failure->diverged}};
  json["scenes_outside_training"] = contest.outside_training;
  json["sentence"] = contest_sentence(contest, comparison);
  return json;
}

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

constexpr Column columns[] = {
    {"frame_ms", "ms/frame"},        {"speed_ratio", "speed"},          {"one_step_normalized", "one-step"},
    {"position_mse_20", "MSE 20"},   {"position_mse_all", "MSE all"},   {"sinkhorn", "sinkhorn"},
    {"density_error", "density"},    {"material_occupancy_iou", "IoU"}, {"clump_size_error", "clumps"},
    {"local_density_error", "local"}};

/// Geometric means of every category and of all scenes; empty where the scenes have no categories, and without
/// rollouts.
std::string category_table(const Comparison& comparison) {
  std::vector<std::string> categories = categories_of(comparison);
  if (categories.empty() || !computed(comparison, MetricGroup::rollout)) return "";
  const std::vector<std::string> models = models_of(comparison);
  std::string table = fmt::format("geometric means by category; r.: over {}, beyond the floor\n  {:<24} {:<18}",
                                  comparison.scenes.front().opponent, "category", "model");
  for (const Column& column : category_columns) table += fmt::format(" {:>8}", column.title);
  table += "\n";
  const auto add = [&](const std::string& name, const std::string& category) {
    for (const std::string& model : models) {
      const MetricValues mean = geometric_mean_over_scenes(comparison, model, category);
      table += fmt::format("  {:<24.24} {:<18.18}", name, short_name(model, models));
      for (const Column& column : category_columns) {
        const auto value = mean.find(column.key);
        table += fmt::format(" {:>8}", value == mean.end() ? "-" : short_number(value->second));
      }
      table += "\n";
    }
  };
  for (const std::string& category : categories)
    add(fmt::format("{} ({})", category, scenes_of_category(comparison, category)), category);
  add(fmt::format("all ({})", comparison.scenes.size()), "");
  return table;
}

/// Of the reduced-order models, what they are held against, and baselines.
std::string reduced_table(const Comparison& comparison, const SceneResult& scene) {
  const std::vector<std::string> models = models_of(comparison);
  std::string table =
      fmt::format("{}: reduced-order models, what they are held against, and baselines\n  {:<28}", scene.name, "model");
  for (const ReducedColumn& column : reduced_columns) table += fmt::format(" {:>8}", column.title);
  table += "  verdict, or runs\n";
  for (const ModelResult& result : scene.models) {
    table += fmt::format("  {:<28.28}", short_name(result.model, models));
    for (const ReducedColumn& column : reduced_columns) table += fmt::format(" {:>8}", reduced_cell(result, column));
    const std::string last = result.trust ? trust_text(result) : result.note;
    table += (last.empty() ? "" : "  " + last) + "\n";
  }
  return table;
}

/// A sentence in lines of at most 120 characters; empty for none.
std::string wrapped(const std::string& sentence) {
  std::istringstream words(sentence);
  std::string text;
  std::size_t width = 0;
  for (std::string word; words >> word; width += word.size() + 1) {
    const bool fits = width + word.size() <= 120;
    if (!text.empty()) text += fits ? " " : "\n";
    if (!fits) width = 0;
    text += word;
  }
  return text.empty() ? "" : text + "\n";
}

std::string table_row(const std::string& name, const MetricValues& values, const std::string& mark) {
  std::string row = fmt::format("  {:<23.23}", name);
  for (const Column& column : columns) {
    const auto value = values.find(column.key);
    row += fmt::format(" {:>8}", value == values.end() ? "-" : short_number(value->second));
  }
  return row + (mark.empty() ? "" : "  " + mark) + "\n";
}

/// 0 for a value that was not computed.
double value_of(const ModelResult& result, const char* key) {
  const auto found = result.values.find(key);
  return found == result.values.end() ? 0 : found->second;
}

std::string mark_of(const ModelResult& result) {
  std::vector<std::string> marks;
  if (const double bundle = value_of(result, "bundle"); bundle > 1)
    marks.push_back(fmt::format("{:.0f} frames at once", bundle));
  if (result.diverged_at_frame >= 0) {
    marks.push_back(fmt::format("diverged at frame {}", result.diverged_at_frame));
  } else {
    if (value_of(result, "loses_to_coarse") > 0) marks.push_back("loses");
    if (const std::string ties = mark_of_ties(result); !ties.empty()) marks.push_back(ties);
    if (!result.remarks.empty()) marks.push_back("unlike its training");
  }
  return fmt::format("{}", fmt::join(marks, "; "));
}

}  // namespace

std::string short_number(double value) {
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (!std::isfinite(value) || size < 1e-3 || size >= 1e5) return fmt::format("{:.2e}", value);
  const int decimals = std::max(0, 2 - static_cast<int>(std::floor(std::log10(size))));
  return fmt::format("{:.{}f}", value, decimals);
}

Json comparison_json(const Comparison& comparison) {
  Json json = {{"format", "graupel comparison 1"},
               {"command", comparison.command},
               {"version", comparison.version},
               {"machine", comparison.machine},
               {"threads", comparison.threads}};
  json["scenes"] = Json::array();
  json["results"] = Json::array();
  for (const SceneResult& scene : comparison.scenes) {
    Json entry = {{"name", scene.name},
                  {"source", scene.source},
                  {"particles", scene.particles},
                  {"frames", scene.frames},
                  {"frame_time", scene.frame_time},
                  {"truth", scene.stored_truth ? "file" : "mpm"},
                  {"true_kinetic_energy", scene.true_energy}};
    if (computed(comparison, MetricGroup::floors))
      entry["floor_curves"] = {{"position_error", scene.floor_position}, {"density_error", scene.floor_density}};
    if (!scene.category.empty()) entry["category"] = scene.category;
    if (!scene.opponent.empty()) {
      entry["opponent"] = scene.opponent;
      entry["opponent_frame_ms"] = scene.opponent_frame_ms;
      entry["mpm_frame_ms"] = scene.mpm_frame_ms;
    }
    if (!scene.diverged_references.empty()) entry["diverged_references"] = scene.diverged_references;
    json["scenes"].push_back(entry);
    for (const ModelResult& result : scene.models) json["results"].push_back(model_json(scene, result));
  }
  json["mean"] = Json::object();
  for (const std::string& model : models_of(comparison))
    json["mean"][model] = values_json(metric_list(), mean_over_scenes(comparison, model));
  json["geometric_mean"] = Json::object();
  for (const std::string& model : models_of(comparison))
    json["geometric_mean"][model] = values_json(metric_list(), geometric_mean_over_scenes(comparison, model));
  json["categories"] = Json::object();
  for (const std::string& category : categories_of(comparison)) {
    Json& entry = json["categories"][category] = {{"scenes", scenes_of_category(comparison, category)}};
    for (const std::string& model : models_of(comparison))
      entry["geometric_mean"][model] =
          values_json(metric_list(), geometric_mean_over_scenes(comparison, model, category));
  }
  if (const std::string sentence = headline(comparison); !sentence.empty()) json["headline"] = sentence;
  json["verdicts"] = Json::array();
  for (const Contest& contest : decisive_contests(comparison))
    json["verdicts"].push_back(contest_json(contest, comparison));
  const std::vector<std::string> sentences = reduced_sentences(comparison);
  if (!sentences.empty()) {
    json["reduced_models"] = sentences;
    json["training_runs"] = comparison.training_runs.empty() ? Json() : Json(comparison.training_runs);
  }
  json["break_even"] = Json::array();
  for (const BreakEven& result : break_evens(comparison))
    json["break_even"].push_back(break_even_json(result, comparison));
  return json;
}

std::string comparison_csv(const Comparison& comparison) {
  std::set<std::string> materials;
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models)
      for (const auto& [material, values] : result.materials) materials.insert(material);
  std::string csv = "scene,model,role,verdict,trust_number,error_bound,diverged_at_frame";
  for (const MetricInfo& metric : metric_list()) csv += "," + metric.key;
  for (const std::string& material : materials)
    for (const MetricInfo& metric : material_metric_list()) csv += "," + material + "." + metric.key;
  csv += "\n";
  const auto cell = [](const MetricValues& values, const std::string& key) {
    const auto value = values.find(key);
    return value == values.end() ? std::string(",") : fmt::format(",{}", value->second);
  };
  for (const SceneResult& scene : comparison.scenes)
    for (const ModelResult& result : scene.models) {
      csv += quoted(scene.name) + "," + quoted(result.model) + "," + name_of(result.role) + "," +
             (result.trust ? fmt::format("{},{}", result.trust->verdict, result.trust->number) : ",") + "," +
             (result.trust && result.trust->bound ? fmt::format("{}", *result.trust->bound) : "") + "," +
             (result.diverged_at_frame >= 0 ? std::to_string(result.diverged_at_frame) : "");
      for (const MetricInfo& metric : metric_list()) csv += cell(result.values, metric.key);
      for (const std::string& material : materials) {
        const auto found = result.materials.find(material);
        for (const MetricInfo& metric : material_metric_list())
          csv += cell(found == result.materials.end() ? MetricValues{} : found->second, metric.key);
      }
      csv += "\n";
    }
  return csv;
}

std::string comparison_table(const Comparison& comparison) {
  std::string header = fmt::format("  {:<23}", "model");
  for (const Column& column : columns) header += fmt::format(" {:>8}", column.title);
  const std::vector<std::string> models = models_of(comparison);
  std::string table;
  for (const SceneResult& scene : comparison.scenes) {
    table += fmt::format("{}: {} particles, {} frames", scene.name, scene.particles, scene.frames);
    if (!scene.opponent.empty()) table += "; to lose is to be worse than " + scene.opponent;
    table += "\n" + header + "\n";
    for (const ModelResult& result : scene.models)
      table += table_row(short_name(result.model, models), result.values, mark_of(result));
    if (computed(comparison, MetricGroup::floors)) table += table_row("(chaos floor)", floors_of(scene), "");
    const std::string mark = mark_of_references(scene);
    if (!mark.empty()) table += "  reference runs: " + mark + "\n";
    if (has_reduced_model(scene)) table += reduced_table(comparison, scene);
  }
  if (comparison.scenes.size() > 1) {
    table += fmt::format("mean of {} scenes\n{}\n", comparison.scenes.size(), header);
    for (const std::string& model : models)
      table += table_row(short_name(model, models), mean_over_scenes(comparison, model),
                         mark_of_missing_scenes(comparison, model));
    table += fmt::format("geometric mean of {} scenes\n{}\n", comparison.scenes.size(), header);
    for (const std::string& model : models)
      table += table_row(short_name(model, models), geometric_mean_over_scenes(comparison, model),
                         mark_of_missing_scenes(comparison, model));
  }
  table += category_table(comparison);
  const std::vector<std::string> sentences = reduced_sentences(comparison);
  if (!sentences.empty()) table += wrapped(reduced_legend(comparison));
  for (const std::string& sentence : sentences) table += wrapped(sentence);
  const std::vector<Contest> decisive = decisive_contests(comparison);
  for (const Contest& contest : decisive) table += wrapped(contest_sentence(contest, comparison));
  if (!decisive.empty()) table += wrapped(floor_sentence(comparison));
  for (const BreakEven& result : break_evens(comparison)) table += wrapped(break_even_sentence(result, comparison));
  return table;
}

}  // namespace graupel::compare
