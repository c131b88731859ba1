#include "experiments/inspection/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/printable.h"
#include "core/system/standard_output.h"
#include "core/system/stop_signal.h"
#include "experiments/comparison/floor_file.h"
#include "experiments/data/scene_source.h"
#include "experiments/data/stored_frames.h"
#include "experiments/inspection/file_facts.h"
#include "experiments/process/input_file.h"
#include "io/config/json_node.h"
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_reader.h"
#include "io/trajectory/input_files.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::ordered_json;

/// Keys that are read together; of what the other readers find, the first.
std::vector<std::string> mistakes_in_json(const std::string& file) {
  if (is_floor_file(file)) return FloorFile(file), std::vector<std::string>();
  if (io::is_sweep(file)) return open_recipe({file, {}, ""}), std::vector<std::string>();
  if (io::is_category_recipe(file)) return io::category_recipe_mistakes(file);
  if (io::is_recipe(file)) return io::recipe_mistakes(file);
  std::vector<std::string> mistakes = io::scene_mistakes(file);
  if (mistakes.empty()) file_facts(file);  // level sets and the grids of obstacles
  return mistakes;
}

/// Numbers of a whole trajectory or data set, and whether the scenes are JSON; their geometry may be elsewhere.
void check_frames(const std::string& file) {
  constexpr int64_t at_once = 8;
  const io::TrajectoryReader reader(file);
  for (int i = 0; i < reader.count(); ++i) {
    const Trajectory header = reader.header(i);
    const std::string name = fmt::format("'{}': trajectory {}", file, i);
    if (!header.scene_json.empty()) io::parse_json(header.scene_json, name + " (its scene)");
    reader.initial_velocity(i);
    reader.contact_forces(i);
    const auto frames = static_cast<int64_t>(header.frame_count());
    for (int64_t first = 0; first < frames; first += at_once)
      check_stored_frames(reader.frames(i, first, std::min(at_once, frames - first), reader.fields(i)), first, name);
  }
}

/// How many trajectories a split has by dataset.json; nothing where that does not tell.
std::optional<int64_t> count_by_card(const Json& card, const std::string& split) {
  const auto at = [&card](const std::string& place) {
    const Json::json_pointer pointer(place);
    return card.contains(pointer) ? card.at(pointer) : Json();
  };
  if (const Json count = at("/recipe/counts/" + split); count.is_number_integer()) return count.get<int64_t>();
  const Json runs = at("/recipe/parameters/0/values"), test = at("/recipe/test"), valid = at("/recipe/valid");
  if (!runs.is_array() || runs.empty() || !test.is_array() || !valid.is_array()) return std::nullopt;
  const auto size = [](const Json& list) { return static_cast<int64_t>(list.size()); };
  return split == "train" ? size(runs) - size(test) - size(valid) : size(split == "test" ? test : valid);
}

/// Every frame of every split, and whether all are there.
std::vector<std::string> mistakes_in_data_set(const std::string& folder) {
  const std::string card_file = folder + "/dataset.json";
  const Json card = Json::parse(read_file(card_file), nullptr, /*allow_exceptions=*/false);
  if (!card.is_object()) throw InputError("'" + card_file + "' is damaged (no JSON object). Make the data set again");
  std::vector<std::string> mistakes;
  bool any = false;
  for (const char* split : {"train", "valid", "test"}) {
    const std::string file = fmt::format("{}/{}.h5", folder, split);
    const std::optional<int64_t> count = count_by_card(card, split);
    any = any || is_there(file) || count.value_or(0) > 0;
    if (!is_there(file)) {
      if (count.value_or(0) > 0)
        mistakes.push_back(
            fmt::format("'{}' is not there, and dataset.json counts {} trajectories in it. Run the same generate "
                        "again, which makes "
                        "what is missing",
                        file, *count));
      continue;
    }
    const std::vector<std::string> of_split = mistakes_in(file);
    mistakes.insert(mistakes.end(), of_split.begin(), of_split.end());
    if (!of_split.empty() || !count) continue;
    if (const int there = io::TrajectoryReader(file).count(); there != *count)
      mistakes.push_back(fmt::format("'{}' holds {} trajectories (dataset.json counts {}). Make the data set again",
                                     file, there, *count));
  }
  if (!any)
    throw InputError("'" + folder + "' has no split that is read here (train.h5, valid.h5, test.h5). Name another");
  return mistakes;
}

}  // namespace

std::vector<std::string> mistakes_in(const std::string& file) {
  const bool state = io::is_state_file(file);
  try {
    if (is_there(file + "/dataset.json")) return mistakes_in_data_set(file);
    if (!state && file.ends_with(".json")) return mistakes_in_json(file);
    file_facts(file);
    if (!state && file.ends_with(".h5")) check_frames(file);
  } catch (const Error& error) {
    const std::string mistake = error.what();
    const bool named = mistake.starts_with(file) || mistake.find("'" + file) != std::string::npos;
    return {named ? mistake : "'" + file + "': " + mistake};
  }
  return {};
}

void validate(ValidateOptions& options) {
  const StopPolicyScope nothing_is_lost(StopPolicy::at_once);
  options.common.apply();
  std::vector<NamedFile> inputs;
  for (const std::string& file : options.files) inputs.push_back({"the file", file});
  io::check_inputs_kept(inputs, {{"--json", options.common.json}});
  nlohmann::ordered_json result = {{"kind", "validation"}, {"files", nlohmann::ordered_json::array()}};
  std::size_t count = 0;
  for (const std::string& file : options.files) {
    std::vector<std::string> mistakes = mistakes_in(file);
    for (std::string& mistake : mistakes) mistake = shortened_message(mistake);
    result["files"].push_back({{"file", file}, {"errors", mistakes}});
    count += mistakes.size();
    for (const std::string& mistake : mistakes) std::printf("%s\n", printable(mistake).c_str());
    if (mistakes.empty()) std::printf("%s: ok\n", printable(file).c_str());
    flush_standard_output();  // what is known by now is told, should the program be stopped
  }
  options.common.write_json(result);
  if (count > 0)
    throw InputError(std::to_string(count) + (count == 1 ? " error" : " errors") + " in " +
                     std::to_string(options.files.size()) + (options.files.size() == 1 ? " file" : " files") +
                     ". Correct what is listed above");
}

}  // namespace graupel::experiments
