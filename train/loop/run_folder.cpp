#include "train/loop/run_folder.h"

#include <sys/utsname.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "graph/features/normalization.h"
#include "io/config/config_description.h"
#include "io/config/json_node.h"
#include "train/loop/crc32c.h"

namespace graupel::train {

namespace fs = std::filesystem;

TrainConfig read_train_config(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides) {
  return io::read_config<TrainConfig>(text, name, overrides);
}

std::string train_config_text(const TrainConfig& config) {
  return io::commented_json(io::describe<TrainConfig>(), io::json_of_struct(config));
}

std::string config_hash(const std::string& config_json) {
  char text[16];
  std::snprintf(text, sizeof(text), "%08x", crc32c(config_json));
  return text;
}

std::string config_hash(const TrainConfig& config) {
  return config_hash(io::write_json(io::json_of_struct(config), io::JsonLayout::compact));
}

std::string run_config_hash(const std::string& folder) {
  const std::string file = folder + "/config.json";
  return config_hash(io::write_json(io::parse_json(read_file(file), file), io::JsonLayout::compact));
}

void check_new_run(const std::string& folder) {
  for (const char* file : {"config.json", "weights.safetensors"})
    if (fs::exists(folder + "/" + file))
      throw ConfigError("'" + folder + "' holds a run already (" + file +
                        "). Go on with it by --resume (coarse: --from), or choose another --out");
}

FileLock lock_run(const std::string& folder) {
  make_folder(folder);
  std::optional<FileLock> lock = FileLock::attempt(folder + "/.lock", LockKind::exclusive);
  if (!lock)
    throw ConfigError("another process trains in '" + folder + "'. Wait until it ends, or choose another --out");
  return std::move(*lock);
}

void create_run(const std::string& folder, const TrainConfig& config, const RunFacts& facts,
                const std::string& command_line) {
  create_run(folder, train_config_text(config), facts, command_line);
}

void create_run(const std::string& folder, const std::string& config_text, const RunFacts& facts,
                const std::string& command_line) {
  check_new_run(folder);
  make_folder(folder);
  make_folder(checkpoint_folder(folder));
  utsname host{};
  ::uname(&host);
  nlohmann::ordered_json environment = {
      {"data", facts.data},       {"device", facts.device},
      {"ranks", facts.ranks},     {"threads", facts.threads},
      {"host", host.nodename},    {"kernel", host.release},
      {"compiler", __VERSION__},  {"torch", facts.torch},
      {"graupel", facts.version}, {"start_cost", nlohmann::ordered_json::parse(nn::offline_cost_json(facts.start))}};
  if (!facts.from.empty()) {
    environment["from"] = facts.from;
    environment["from_hash"] = facts.from_hash;
  }
  if (!facts.teacher.empty()) {
    environment["teacher"] = facts.teacher;
    environment["teacher_hash"] = facts.teacher_hash;
  }
  if (!facts.data_hash.empty()) environment["data_hash"] = facts.data_hash;
  if (facts.time_limit > 0) environment["time_limit"] = facts.time_limit;
  write_file_atomically(folder + "/run.json", environment.dump(2) + "\n");
  write_file_atomically(folder + "/command.txt", command_line + "\n");
  write_file_atomically(folder + "/config.json", config_text);
}

TrainConfig read_run_config(const std::string& folder) {
  const std::string file = folder + "/config.json";
  if (!fs::exists(file)) throw InputError("'" + folder + "' is not a training run (it has no config.json)");
  return read_train_config(read_file(file), file);
}

RunFacts read_run_facts(const std::string& folder) {
  const std::string file = folder + "/run.json";
  const auto json = nlohmann::json::parse(read_file(file), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) throw InputError("'" + file + "' is damaged (not a JSON object). Start a new run");
  RunFacts facts;
  try {
    facts.data = json.value("data", "");
    facts.device = json.value("device", "");
    facts.torch = json.value("torch", "");
    facts.version = json.value("graupel", "");
    facts.threads = json.value("threads", 0);
    facts.ranks = json.value("ranks", 1);
    facts.data_hash = json.value("data_hash", "");
    facts.time_limit = json.value("time_limit", 0.0);
    facts.from = json.value("from", "");
    facts.from_hash = json.value("from_hash", "");
    facts.teacher = json.value("teacher", "");
    facts.teacher_hash = json.value("teacher_hash", "");
  } catch (const nlohmann::json::type_error& error) {
    throw InputError("'" + file + "' is damaged (" + error.what() + "). Start a new run");
  }
  const auto start = json.find("start_cost");
  facts.start = start == json.end() ? nn::unknown_offline_cost()
                                    : nn::parse_offline_cost(start->dump(), "'" + file + "' (start_cost)");
  return facts;
}

bool began_with_other_data(const RunFacts& facts, const std::string& data_hash) {
  return !facts.data_hash.empty() && facts.data_hash != data_hash;
}

namespace {

/// Runs of reduced models have no such setting.
bool is_run_of(Architecture architecture, const std::string& config) {
  try {
    const nlohmann::json json = nlohmann::json::parse(read_file(config), nullptr, true, /*ignore_comments=*/true);
    return json.is_object() && json.value("architecture", "") == word_of(architecture);
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace

std::string latest_run(const std::string& folder, Architecture architecture) {
  std::string latest;
  fs::file_time_type newest;
  for (const std::string& name : names_in(folder)) {
    const std::string run = folder + "/" + name, config = run + "/config.json", metrics = run + "/metrics.csv";
    if (!fs::exists(config) || !is_run_of(architecture, config)) continue;
    const auto time = fs::last_write_time(fs::exists(metrics) ? metrics : config);
    if (latest.empty() || time > newest) {
      latest = run;
      newest = time;
    }
  }
  if (latest.empty())
    throw InputError("there is no training run of " + std::string(word_of(architecture)) + " in '" + folder +
                     "'. Name the run: --resume RUN");
  return latest;
}

void write_run_normalization(const std::string& folder, const graph::Normalization& normalization) {
  nn::Weights weights;
  graph::add_normalization(weights, normalization);
  nn::write_safetensors(folder + "/normalization.safetensors", weights);
}

graph::Normalization read_run_normalization(const std::string& folder) {
  return graph::read_normalization(nn::read_safetensors(folder + "/normalization.safetensors"));
}

}  // namespace graupel::train
