#include "experiments/comparison/compare_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "compare/comparison_files.h"
#include "compare/pictures/contact_sheet.h"
#include "compare/pictures/png.h"
#include "compare/report/report.h"
#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/printable.h"
#include "core/system/standard_output.h"
#include "experiments/comparison/compare_scene.h"
#include "experiments/comparison/fairness.h"
#include "experiments/comparison/model_fit.h"
#include "experiments/process/file_name.h"
#include "experiments/process/json_text.h"
#include "experiments/process/process.h"
#include "io/trajectory/input_files.h"
#include "nn/offline_cost.h"
#include "nn/weights.h"

namespace graupel::experiments {

namespace {

std::vector<ModelChoice> parse_models(const std::vector<std::string>& words) {
  if (words.empty())
    throw ConfigError("compare needs at least one model. Example: --models mpm,models/hgn.safetensors");
  std::vector<ModelChoice> models;
  std::set<std::string> seen;
  const auto give_settings = [&] {  // corrections alone are those of the run's first network
    const auto first = std::find_if(models.begin(), models.end(), [](const ModelChoice& m) {
      return m.kind == ModelKind::network && !m.weights.empty();
    });
    for (ModelChoice& model : models) {
      if (model.kind != ModelKind::network || !model.weights.empty()) continue;
      if (first == models.end())
        throw ConfigError("'" + model.name +
                          "' needs the settings of a network: cell size and frames at once. Name one in "
                          "--models, or write WEIGHTS:corrections-only");
      model.weights = first->weights;
      model.contents = first->contents;
    }
  };
  for (const std::string& word : words) {
    if (!seen.insert(word).second) throw ConfigError("model '" + word + "' is named twice in --models. Name it once");
    models.push_back(parse_model(word, models));
    models.back().label = compare::short_name(word, words);
  }
  give_settings();
  return models;
}

/// The same reduced-order model whose steps do not go part of the way to its training runs.
ComparedModel without_pull(ComparedModel model) {
  model.choice.pull = Pull::none;
  model.choice.name += no_pull_suffix;
  model.choice.label += no_pull_suffix;
  return model;
}

/// The models of --models. After a reduced-order model whose steps are drawn to its training runs comes the same
/// without: what it knows by itself, which no comparison leaves out.
std::vector<ComparedModel> load_models(const std::vector<ModelChoice>& choices, Device device) {
  std::vector<ComparedModel> models;
  for (const ModelChoice& choice : choices) {
    ComparedModel model{choice, nullptr, nullptr, nullptr};
    for (const ComparedModel& other : models)
      if (other.choice.weights == choice.weights) model.network = other.network;
    if (choice.kind == ModelKind::network && !model.network) {
      model.network = std::make_shared<const graph::LearnedSimulator>(choice.contents);
      model.network->check_runs_on(device);
    }
    if (choice.kind == ModelKind::reduced) model.reduced = std::make_shared<const LoadedModel>(*choice.contents);
    if (choice.kind == ModelKind::coarse)
      model.coarse = std::make_shared<const hybrid::CoarseModel>(hybrid::CoarseModel::load(*choice.contents));
    models.push_back(std::move(model));
    const ComparedModel& last = models.back();
    const bool pulled = last.reduced && choice.pull == Pull::as_trained && last.reduced->model.manifold_pull > 0;
    const auto named = [&](const ModelChoice& other) { return other.name == choice.name + no_pull_suffix; };
    if (pulled && std::none_of(choices.begin(), choices.end(), named)) models.push_back(without_pull(last));
  }
  return models;
}

/// Nothing for MPM and for corrections alone, which no data are behind.
std::optional<compare::OfflineTime> offline_time_of(const ComparedModel& model) {
  if (model.choice.kind == ModelKind::mpm || model.choice.parts == NetworkParts::corrections_alone) return std::nullopt;
  const nn::OfflineCost cost = nn::offline_cost_of(model.choice.contents->metadata, model.choice.weights);
  compare::OfflineTime time{
      .data = nn::total_seconds(cost.data), .training = nn::total_seconds(cost.training), .devices = {}};
  std::set<std::string> seen;
  for (const auto* parts : {&cost.data, &cost.training})
    for (const nn::CostPart& part : *parts)
      if (nn::total_seconds(*parts) && seen.insert(part.device).second)
        time.devices.push_back(part.device.empty() ? "hardware that is not told" : part.device);
  return time;
}

/// Before anything is run: flags that ask for what will not be there.
void check_flags(const CompareOptions& options) {
  if (options.one_step_only && !options.pictures.empty())
    throw ConfigError("--pictures '" + options.pictures +
                      "' shows rollouts, and --one-step-only makes none. Leave out one of them");
  if (options.one_step_only && options.forces)
    throw ConfigError("--forces records rollouts, and --one-step-only makes none. Leave out one of them");
  if (options.forces && options.report.empty())
    throw ConfigError("--forces is for the plots of a report, and none is written. Add --report FILE.html");
}

void check_one_step_only(const std::vector<ModelChoice>& models) {
  for (const ModelChoice& model : models)
    if (model.kind == ModelKind::reduced || model.kind == ModelKind::coarse ||
        (model.kind == ModelKind::mpm && !(model.variant == mpm::same_solver)))
      throw ConfigError("'" + model.name +
                        "' has no one-step error without a rollout. Leave it or --one-step-only out");
}

/// The file of "WEIGHTS.safetensors:no-pull".
std::string file_of(const std::string& model) {
  const std::string ending = ".safetensors";
  const std::size_t at = model.find(ending + ":");
  return at == std::string::npos ? model : model.substr(0, at + ending.size());
}

void check_outputs(const CompareOptions& options) {
  for (const std::string& model : options.models)
    if (model.empty() || model.starts_with("--"))
      throw ConfigError("'" + model + "' is not a model. Example: --models mpm,models/hgn.safetensors");
  for (const std::string& file : {options.json, options.csv, options.report, options.write_floors})
    check_output_file(file);
  check_output_folder(options.pictures);
  std::vector<NamedFile> inputs = {{"the floors", options.floor_file}, {"the training runs", options.training_runs}};
  for (const std::string& scene : options.scenes) inputs.push_back({"the scenes", scene});
  for (const std::string& model : options.models) inputs.push_back({"the model", file_of(model)});
  io::check_inputs_kept(inputs,
                        {{"--json", options.json},
                         {"--csv", options.csv},
                         {"--report", options.report},
                         {"--write-floors", options.write_floors}},
                        options.set);
}

/// One contact sheet a scene and model: the truth above, the model below.
void write_pictures(const compare::Comparison& comparison, const std::string& folder) {
  make_folder(folder);
  const std::vector<std::string> models = compare::models_of(comparison);
  std::set<std::string> written;  // names of models may differ in what no file's name has
  for (const compare::SceneResult& scene : comparison.scenes)
    for (const compare::ModelResult& result : scene.models) {
      const auto sheet = compare::stack_rows({compare::decode_png(scene.picture), compare::decode_png(result.picture)});
      std::string model = std::filesystem::path(compare::short_name(result.model, models)).replace_extension();
      std::replace(model.begin(), model.end(), ':', '_');
      std::string file = file_name_of(scene.name + "-" + model);
      while (!written.insert(file).second) file += "_";
      write_file_atomically(folder + "/" + file + ".png", compare::encode_png(sheet));
    }
}

void write_files(const compare::Comparison& comparison, const CompareOptions& options) {
  if (!options.json.empty())
    write_file_atomically(options.json, json_text(compare::comparison_json(comparison), 1) + "\n");
  if (!options.csv.empty()) write_file_atomically(options.csv, compare::comparison_csv(comparison));
  if (!options.report.empty()) write_file_atomically(options.report, compare::report_html(comparison));
  if (!options.pictures.empty()) write_pictures(comparison, options.pictures);
}

void print_table(const compare::Comparison& comparison) {
  std::fputs(printable(compare::comparison_table(comparison)).c_str(), stdout);
  std::fflush(stdout);
  for (const compare::SceneResult& scene : comparison.scenes) {
    for (const auto& [reference, frame] : scene.diverged_references)
      warn(fmt::format("reference run '{}' diverged at frame {} of {}; its last usable frame stands in for the rest",
                       reference, frame, scene.name));
    for (const compare::ModelResult& result : scene.models)
      if (result.diverged_at_frame >= 0)
        warn(fmt::format("{} diverged at frame {} of {}; its last usable frame stands in for the rest", result.model,
                         result.diverged_at_frame, scene.name));
  }
}

/// After which the scenes before it are worth keeping.
bool is_of_a_scene(const Error& error) {
  return error.code() == ExitCode::diverged || error.code() == ExitCode::usage || error.code() == ExitCode::bad_input;
}

/// The same kind of error with another text.
[[noreturn]] void throw_again(const Error& error, const std::string& text) {
  if (error.code() == ExitCode::diverged) throw DivergedError(text);
  if (error.code() == ExitCode::bad_input) throw InputError(text);
  throw ConfigError(text);
}

/// Fills `comparison` scene by scene, so that the complete ones are there when one cannot be run.
void compare_scenes(const CompareOptions& options, compare::Comparison& comparison, FloorFile& measured) {
  set_num_threads(options.threads);
  const auto choices = parse_models(options.models);
  const Device device = common_device(options.device, choices);
  if (options.one_step_only) check_one_step_only(choices);
  const auto models = load_models(choices, device);
  const auto tasks = read_scene_tasks(options);
  for (const SceneTask& task : tasks)
    if (task.stored && task.stored->made_by != "mpm" && !task.stored->made_by.empty())
      warn(fmt::format("the truth of '{}' was made by '{}', not by MPM", task.source, task.stored->made_by));
  if (!options.floor_file.empty()) {
    const FloorFile known(options.floor_file);  // stale floors are refused before anything long is run
    for (const SceneTask& task : tasks) known.of(task.scene, task.seed, task.frames);
  }
  const bool any_reduced =
      std::any_of(models.begin(), models.end(), [](const ComparedModel& model) { return model.reduced != nullptr; });
  std::optional<TrainingRuns> runs;
  if (!options.training_runs.empty()) {
    if (!any_reduced)
      throw ConfigError(
          "--training-runs is for baselines of reduced-order models, and --models names none. Leave it out");
    runs.emplace(options.training_runs);
  }
  const auto models_of_task = fitting_models(tasks, models, options, runs ? &*runs : nullptr, device);

  comparison.command = options.command;
  comparison.version = version_text();
  comparison.machine =
      fmt::format("{}, MPM on {}", processor_name(), device == Device::cuda ? cuda_device_name() : "the CPU");
  comparison.threads = num_threads();
  comparison.training_runs = options.training_runs;
  comparison.hardware = hardware_name(device, num_threads());
  for (const ComparedModel& model : models)
    if (const auto offline = offline_time_of(model)) comparison.offline[model.choice.name] = *offline;
  using enum compare::MetricGroup;
  comparison.groups = {one_step};
  if (!options.one_step_only) comparison.groups = {rollout, one_step, cost};
  if (!options.one_step_only && options.floors) comparison.groups.insert(comparison.groups.end(), {floors, ratios});
  const auto budget = compare::report_budget(tasks.size() * (models.size() + 1 + (any_reduced ? most_baselines : 0)));
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const SceneTask& task = tasks[t];
    try {
      SceneComparison scene(options, task, device, budget, runs ? &*runs : nullptr);
      comparison.scenes.push_back(scene.run(models_of_task[t]));
      measured.add(task.scene.name, scene.floors());
    } catch (const Error& error) {
      if (!is_of_a_scene(error)) throw;
      const bool diverged = error.code() == ExitCode::diverged;
      throw_again(error, fmt::format("{}scene '{}' ('{}'){}: {}", diverged ? "the truth of " : "", task.scene.name,
                                     task.source, diverged ? " diverged" : "", error.what()));
    }
  }
}

/// Table and files of what is there.
void write_results(const compare::Comparison& comparison, const CompareOptions& options) {
  print_table(comparison);
  write_files(comparison, options);
}

}  // namespace

compare::Comparison make_comparison(const CompareOptions& options) {
  compare::Comparison comparison;
  FloorFile measured;
  compare_scenes(options, comparison, measured);
  return comparison;
}

void run_compare(const CompareOptions& options) {
  check_flags(options);
  check_outputs(options);
  if (options.json == "-" || options.csv == "-" || options.report == "-") reserve_standard_output();
  compare::Comparison comparison;
  FloorFile measured;
  try {
    compare_scenes(options, comparison, measured);
  } catch (const Error& error) {
    if (comparison.scenes.empty() || !is_of_a_scene(error)) throw;
    write_results(comparison, options);
    throw_again(error, fmt::format("{}. Tables and files hold the {} scene{} before it", error.what(),
                                   comparison.scenes.size(), comparison.scenes.size() == 1 ? "" : "s"));
  }
  write_results(comparison, options);
  if (!options.write_floors.empty()) measured.write(options.write_floors);
  const auto incomplete = compare::incomplete_results(comparison);
  if (!incomplete.empty())
    throw Error(ExitCode::failed,
                fmt::format("{} metrics are missing or not finite, the first: {}. The files hold the others",
                            incomplete.size(), incomplete.front()));
}

}  // namespace graupel::experiments
