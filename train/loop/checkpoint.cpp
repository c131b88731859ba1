#include "train/loop/checkpoint.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/unfinished_file.h"
#include "train/loop/crc32c.h"

namespace graupel::train {

using Json = nlohmann::ordered_json;

namespace {

constexpr const char* prefix = "step-";

std::string folder_name(int64_t step) {
  char text[32];
  std::snprintf(text, sizeof(text), "%s%08lld", prefix, static_cast<long long>(step));
  return text;
}

/// Checkpoints of a folder, oldest first; unfinished ones (".part") are none.
std::vector<int64_t> steps_in(const std::string& folder) {
  std::vector<int64_t> steps;
  for (const std::string& name : names_in(folder)) {
    const std::string number = name.starts_with(prefix) ? name.substr(5) : "";
    if (!number.empty() && number.size() < 19 && number.find_first_not_of("0123456789") == std::string::npos)
      steps.push_back(std::stoll(number));
  }
  std::sort(steps.begin(), steps.end());
  return steps;
}

/// Calls use(key, member) for all that state.json holds of it, in its order.
template <typename State, typename Use>
void at_fields(State& state, const Use& use) {
  use("step", state.step);
  use("seed", state.seed);
  use("config_hash", state.config_hash);
  use("seconds", state.seconds);
  use("loss_average", state.loss_average);
  use("best_validation", state.best_validation);
  use("best_step", state.best_step);
}

std::string file_of(const std::string& folder, const std::string& array) {
  return folder + "/" + array + ".safetensors";
}

/// A folder whose files are removed with it, without any memory, unless it is kept.
class UnfinishedFolder {
 public:
  UnfinishedFolder(std::string path, const Checkpoint& checkpoint) : path_(std::move(path)) {
    for (const auto& [name, weights] : checkpoint.arrays)
      files_.push_back(std::make_unique<UnfinishedFile>(file_of(path_, name)));
    files_.push_back(std::make_unique<UnfinishedFile>(path_ + "/state.json"));
  }
  ~UnfinishedFolder() {
    files_.clear();
    ::rmdir(path_.c_str());
  }
  UnfinishedFolder(const UnfinishedFolder&) = delete;
  UnfinishedFolder& operator=(const UnfinishedFolder&) = delete;
  /// It has another name now.
  void keep() {
    for (const auto& file : files_) file->keep();
  }

 private:
  std::string path_;
  std::vector<std::unique_ptr<UnfinishedFile>> files_;
};

void fill(const std::string& folder, const Checkpoint& checkpoint) {
  make_folder(folder);
  Json json;
  at_fields(checkpoint.state, [&](const char* key, const auto& value) { json[key] = value; });
  for (const auto& [name, weights] : checkpoint.arrays) {
    const std::string file = file_of(folder, name);
    nn::write_safetensors(file, weights);
    json["crc32c"][name] = crc32c(read_file(file));
  }
  write_file_atomically(folder + "/state.json", json.dump(2) + "\n");
}

}  // namespace

void write_checkpoint(const std::string& folder, const Checkpoint& checkpoint) {
  const std::string path = folder + "/" + folder_name(checkpoint.state.step), part = path + ".part";
  remove_path(part);  // left by a kill
  UnfinishedFolder unfinished(part, checkpoint);
  fill(part, checkpoint);
  remove_path(path);  // a damaged one of the same step
  finish_part_file(path);
  unfinished.keep();
}

Checkpoint read_checkpoint(const std::string& path) {
  Checkpoint checkpoint;
  try {
    const Json json = Json::parse(read_file(path + "/state.json"));
    at_fields(checkpoint.state, [&](const char* key, auto& value) { json.at(key).get_to(value); });
    for (const auto& [name, sum] : json.at("crc32c").items()) {
      const std::string file = file_of(path, name);
      if (crc32c(read_file(file)) != sum.get<uint32_t>())
        throw InputError("'" + file + "' is damaged (its checksum is not the recorded one)");
      checkpoint.arrays[name] = nn::read_safetensors(file);
    }
  } catch (const nlohmann::json::exception& error) {
    throw InputError("'" + path + "/state.json' is damaged (" + error.what() + ")");
  }
  return checkpoint;
}

std::optional<Checkpoint> read_latest_checkpoint(const std::string& folder,
                                                 const std::function<void(const std::string&)>& warn) {
  std::vector<int64_t> steps = steps_in(folder);
  if (steps.empty()) return std::nullopt;
  for (; !steps.empty(); steps.pop_back()) {
    try {
      return read_checkpoint(folder + "/" + folder_name(steps.back()));
    } catch (const InputError& error) {
      warn("WARNING: checkpoint of step " + std::to_string(steps.back()) + " cannot be used: " + error.what() +
           ". Going back to the one before it");
    }
  }
  throw InputError("no checkpoint in '" + folder + "' can be used (all are damaged). Start the run anew");
}

std::optional<Checkpoint> checkpoint_to_resume(const std::string& folder, const std::string& config_hash,
                                               const std::function<void(const std::string&)>& say) {
  auto checkpoint = read_latest_checkpoint(folder, say);
  if (!checkpoint)
    say("the run has no checkpoint yet: starting at step 0");
  else if (checkpoint->state.config_hash != config_hash)
    throw ConfigError("the checkpoint was made with other settings (fingerprint " + checkpoint->state.config_hash +
                      ", config.json has " + config_hash + "). Restore config.json, or start a new run");
  return checkpoint;
}

void prune_checkpoints(const std::string& folder, int64_t best_step) {
  const std::vector<int64_t> steps = steps_in(folder);
  for (std::size_t i = 0; i + 2 < steps.size(); ++i)
    if (steps[i] != best_step) remove_path(folder + "/" + folder_name(steps[i]));
}

}  // namespace graupel::train
