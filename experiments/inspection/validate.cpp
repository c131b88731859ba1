#include "experiments/inspection/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "core/system/printable.h"
#include "core/system/stop_signal.h"
#include "experiments/comparison/floor_file.h"
#include "experiments/data/stored_frames.h"
#include "experiments/inspection/file_facts.h"
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_reader.h"
#include "io/trajectory/input_files.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

namespace {

/// Keys that are read together; of what the other readers find, the first.
std::vector<std::string> mistakes_in_json(const std::string& file) {
  if (is_floor_file(file)) return FloorFile(file), std::vector<std::string>();
  if (io::is_sweep(file)) return io::read_sweep(file), std::vector<std::string>();
  if (io::is_category_recipe(file)) return io::category_recipe_mistakes(file);
  if (io::is_recipe(file)) return io::recipe_mistakes(file);
  std::vector<std::string> mistakes = io::scene_mistakes(file);
  if (mistakes.empty()) file_facts(file);  // level sets and the grids of obstacles
  return mistakes;
}

/// Numbers of a whole trajectory or data set.
void check_frames(const std::string& file) {
  constexpr int64_t at_once = 8;
  const io::TrajectoryReader reader(file);
  for (int i = 0; i < reader.count(); ++i) {
    const auto frames = static_cast<int64_t>(reader.header(i).frame_count());
    for (int64_t first = 0; first < frames; first += at_once)
      check_stored_frames(reader.frames(i, first, std::min(at_once, frames - first), reader.fields(i)), first,
                          fmt::format("'{}': trajectory {}", file, i));
  }
}

}  // namespace

std::vector<std::string> mistakes_in(const std::string& file) {
  const bool state = io::is_state_file(file);
  try {
    if (!state && file.ends_with(".json")) return mistakes_in_json(file);
    file_facts(file);
    if (!state && file.ends_with(".h5")) check_frames(file);
  } catch (const Error& error) {
    return {error.what()};
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
    const std::vector<std::string> mistakes = mistakes_in(file);
    result["files"].push_back({{"file", file}, {"errors", mistakes}});
    count += mistakes.size();
    for (const std::string& mistake : mistakes) std::printf("%s\n", printable(mistake).c_str());
    if (mistakes.empty()) std::printf("%s: ok\n", file.c_str());
  }
  options.common.write_json(result);
  if (count > 0)
    throw InputError(std::to_string(count) + (count == 1 ? " error" : " errors") + " in " +
                     std::to_string(options.files.size()) + (options.files.size() == 1 ? " file" : " files") +
                     ". Correct what is listed above");
}

}  // namespace graupel::experiments
