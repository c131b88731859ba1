#include "compare/reduced_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "compare/comparison_files.h"

namespace graupel::compare {

namespace {

constexpr const char* unknown = "unknown";  ///< verdict of a model without calibration runs

const ModelResult* result_of(const SceneResult& scene, const std::string& model) {
  const auto found = std::find_if(scene.models.begin(), scene.models.end(),
                                  [&](const ModelResult& result) { return result.model == model; });
  return found == scene.models.end() ? nullptr : &*found;
}

bool has_values(const ModelResult& result) {
  return std::all_of(std::begin(reduced_columns), std::end(reduced_columns),
                     [&](const ReducedColumn& column) { return result.values.contains(column.key); });
}

std::vector<const SceneResult*> scenes_of(const Comparison& comparison, const std::string& model) {
  std::vector<const SceneResult*> scenes;
  for (const SceneResult& scene : comparison.scenes)
    if (const ModelResult* result = result_of(scene, model); result != nullptr && has_values(*result))
      scenes.push_back(&scene);
  return scenes;
}

/// Mean over the scenes; none where the model was not run in all of them.
std::optional<double> mean_of(const std::vector<const SceneResult*>& scenes, const std::string& model,
                              const ReducedColumn& column) {
  double sum = 0;
  for (const SceneResult* scene : scenes) {
    const ModelResult* result = result_of(*scene, model);
    if (result == nullptr || !result->values.contains(column.key)) return std::nullopt;
    sum += column.scale * result->values.at(column.key);
  }
  return sum / static_cast<double>(scenes.size());
}

/// "3.5 ms a frame (less than mpm 32.6; more than mpm:coarse:fast 2.1)": `who` are the rows to hold it against.
std::string held_against(const std::vector<const SceneResult*>& scenes, const std::string& model,
                         const std::vector<std::string>& who, const std::vector<std::string>& all,
                         const ReducedColumn& column, const std::string& unit) {
  const double own = mean_of(scenes, model, column).value_or(0);
  std::string less, more;
  for (const std::string& other : who) {
    const auto value = mean_of(scenes, other, column);
    if (!value) continue;
    std::string& list = own < *value ? less : more;
    list += (list.empty() ? "" : ", ") + short_name(other, all) + " " + short_number(*value);
  }
  std::string text = short_number(own) + unit;
  if (less.empty() && more.empty()) return text;
  text += " (";
  if (!less.empty()) text += "less than " + less;
  if (!more.empty()) text += (less.empty() ? "" : "; ") + std::string("not less than ") + more;
  return text + ")";
}

/// "ok", or "ok in 3, doubtful in 1 of 4 scenes", and what that is worth.
std::string verdicts_text(const std::vector<const SceneResult*>& scenes, const std::string& model) {
  std::map<std::string, int> count;
  for (const SceneResult* scene : scenes)
    if (const ModelResult* result = result_of(*scene, model); result->trust) ++count[result->trust->verdict];
  if (count.empty()) return "none";
  std::string text;
  for (const auto& [verdict, times] : count)
    text += (text.empty() ? "" : ", ") + verdict + (count.size() == 1 ? "" : fmt::format(" in {}", times));
  if (count.size() > 1) text += fmt::format(" of {} scenes", scenes.size());
  if (count.size() == 1 && count.contains(unknown)) return text;
  if (std::all_of(scenes.begin(), scenes.end(),
                  [&](const SceneResult* scene) { return result_of(*scene, model)->trust->bound.has_value(); }))
    return text;
  return fmt::format("{} (errors up to {:.2g} % on training runs)", text,
                     100 * result_of(*scenes.front(), model)->trust->training_error);
}

}  // namespace

bool has_reduced_model(const SceneResult& scene) {
  return std::any_of(scene.models.begin(), scene.models.end(),
                     [](const ModelResult& result) { return result.role == ModelRole::reduced && has_values(result); });
}

std::string reduced_cell(const ModelResult& result, const ReducedColumn& column) {
  const auto value = result.values.find(column.key);
  return value == result.values.end() ? "-" : short_number(column.scale * value->second);
}

std::string trust_text(const ModelResult& result) {
  if (!result.trust) return "";
  const std::string pull = result.manifold_pull > 0 ? fmt::format(", pull {:.2g}", result.manifold_pull) : "";
  if (result.trust->verdict == unknown) return unknown + pull;
  if (result.trust->bound)
    return fmt::format("{} (bound {:.2g} %){}", result.trust->verdict, 100 * *result.trust->bound, pull);
  return fmt::format("{} ({:.2f}; {:.2g} %){}", result.trust->verdict, result.trust->number,
                     100 * result.trust->training_error, pull);
}

std::string reduced_legend(const Comparison& comparison) {
  std::string text =
      "displ. %: distance to the truth over the displacement, 100 for a body at rest. MiB: what the model takes, "
      "without the frames that the comparison keeps. verdict: a reduced-order model's own judgement of the run, made "
      "without the truth: ok where its bound on displ. % is at most 5, doubtful up to 20. Without a bound, ok where "
      "its "
      "error indicator (first in brackets) is at most 1.5 times what it was on training runs, whose largest error "
      "stands second; doubtful up to 3. It does not say that the model beats the baselines.";
  if (std::any_of(comparison.scenes.begin(), comparison.scenes.end(), [](const SceneResult& scene) {
        return std::any_of(scene.models.begin(), scene.models.end(),
                           [](const ModelResult& result) { return result.manifold_pull > 0; });
      }))
    text +=
        " pull: share of the way to its training runs that each step of the model takes (manifold_pull), so that it "
        "contains the line between them; the row with :no-pull is the same model without.";
  if (comparison.training_runs.empty())
    text +=
        " Left out: the nearest training run and the interpolation between training runs; --training-runs FOLDER names "
        "the data set.";
  return text;
}

std::vector<std::string> reduced_sentences(const Comparison& comparison) {
  const std::vector<std::string> models = models_of(comparison);
  std::vector<std::string> sentences;
  for (const std::string& model : models) {
    const auto scenes = scenes_of(comparison, model);
    if (scenes.empty() || result_of(*scenes.front(), model)->role != ModelRole::reduced) continue;
    std::vector<std::string> rivals, solvers;  // in error; in time and memory
    for (const std::string& other : models) {
      const ModelResult* result = result_of(*scenes.front(), other);
      if (other == model || result == nullptr) continue;
      if (other != "mpm") rivals.push_back(other);
      if (result->role != ModelRole::baseline) solvers.push_back(other);
    }
    sentences.push_back(fmt::format(
        "{} on {}: error {}; {}; {}; its verdict on itself: {}.", short_name(model, models),
        scenes.size() == 1 ? scenes.front()->name : fmt::format("{} scenes", scenes.size()),
        held_against(scenes, model, rivals, models, reduced_columns[0], " % of the displacement"),
        held_against(scenes, model, solvers, models, reduced_columns[2], " ms a frame"),
        held_against(scenes, model, solvers, models, reduced_columns[4], " MiB"), verdicts_text(scenes, model)));
  }
  return sentences;
}

}  // namespace graupel::compare
