#include "experiments/inspection/inspect.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "core/system/printable.h"
#include "core/system/stop_signal.h"
#include "experiments/inspection/file_facts.h"
#include "experiments/inspection/training_curves.h"
#include "experiments/process/process.h"
#include "io/trajectory/input_files.h"
#include "io/trajectory/recovered_file.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::ordered_json;

/// `file` is the finished name; what is on disk is `file`.part.
Json recover(const std::string& file, const InspectOptions& options) {
  const std::string name = file.ends_with(".part") ? file.substr(0, file.size() - 5) : file;
  const std::string whole = options.output.empty() ? name : options.output;
  check_library_output(whole);
  check_apart({{"what is recovered", name + ".part"}}, {{"--output", whole == name ? "" : whole}});
  check_apart({{"what is recovered", name + ".part"}}, {{"--json", options.common.json}});
  check_apart({}, {{"the recovered file", whole}, {"--json", options.common.json}});
  const int64_t frames = io::recover_part_file_to(name, whole);
  if (frames == 0)
    throw InputError("no frame of '" + name +
                     ".part' could be recovered (the run was ended before its first flush). Run it again");
  return {{"kind", "recovered"}, {"file", whole}, {"frames", frames}};
}

std::string on_one_line(std::string text) {
  text = printable(text);
  std::replace(text.begin(), text.end(), '\n', '?');
  return text;
}

/// Plain text: one "key: value" a line, nested values indented; long lists of tensors stay in the JSON.
void print(const Json& value, int indent) {
  for (const auto& [key, item] : value.items()) {
    if (key == "tensors") continue;
    if (item.is_object() || (item.is_array() && !item.empty() && item.front().is_object())) {
      std::printf("%*s%s:\n", indent, "", on_one_line(key).c_str());
      print(item, indent + 2);
    } else {
      const std::string value_text = item.is_string() ? item.get<std::string>() : item.dump();
      std::printf("%*s%s: %s\n", indent, "", on_one_line(key).c_str(), on_one_line(value_text).c_str());
    }
  }
}

void print(const TrainingCurve& curve) {
  std::printf("%s\n%10s %10s %28s %22s\n", curve.name.c_str(), "step", "minutes", "one-step, of the baseline's",
              "rollout MSE [m^2]");
  for (const Validation& v : curve.validations)
    std::printf("%10.0f %10.2f %28.4g %22.4g\n", v.step, v.seconds / 60, v.one_step, v.rollout_mse);
}

Json inspect_runs(const InspectOptions& options) {
  std::vector<TrainingCurve> curves;
  Json runs = Json::array();
  for (const std::string& folder : options.files) {
    if (!is_run_folder(folder))
      throw ConfigError("'" + folder +
                        "' is no folder of a training run (it has no metrics.csv), and several files can be inspected "
                        "only where all are. Name run folders");
    curves.push_back(read_training_curve(folder));
    print(curves.back());
    runs.push_back(to_json(curves.back()));
  }
  Json result = {{"kind", "training runs"}, {"runs", runs}};
  if (options.plots.empty()) return result;
  const std::vector<std::string> plots = write_training_plots(curves, options.plots);
  result["plots"] = plots;
  if (plots.empty()) warn("no plot is written to '" + options.plots + "': the runs have measured nothing so far");
  for (const std::string& file : plots) std::printf("%s\n", file.c_str());
  return result;
}

}  // namespace

void inspect(InspectOptions& options) {
  const StopPolicyScope policy(options.recover || !options.plots.empty() ? StopPolicy::within_a_second
                                                                         : StopPolicy::at_once);
  options.common.apply();
  std::vector<NamedFile> files;
  for (const std::string& file : options.files) files.push_back({"the file", file});
  io::check_inputs_kept(files, {{"--json", options.common.json}});
  const std::string& first = options.files.front();
  const bool runs = options.files.size() > 1 || is_run_folder(first);
  if (runs && options.recover)
    throw ConfigError(
        "--recover is for one trajectory ('" + first +
        (options.files.size() > 1 ? "' and others were named). Name one FILE" : "' is a training run). Leave it out"));
  if (!runs && !options.plots.empty())
    throw ConfigError("--plots is for folders of training runs ('" + first + "' is none). Leave it out");
  if (!options.recover && !options.output.empty())
    throw ConfigError("--output is for what --recover makes ('" + options.output + "'). Leave it out");
  const Json result = runs ? inspect_runs(options) : options.recover ? recover(first, options) : file_facts(first);
  if (!runs) print(result, 0);
  options.common.write_json(result);
}

}  // namespace graupel::experiments
