// What the commands that train reduced-order models share: their options, settings, run folder and result.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/system/atomic_file.h"
#include "core/system/command_line.h"
#include "io/config/config_description.h"
#include "nn/weights.h"
#include "rom/reduced_model.h"
#include "train/commands/run_log.h"
#include "train/reduced/error_calibration.h"
#include "train/reduced/mlp/stage_run.h"

namespace graupel::train {

struct ReducedArguments {
  std::string data, out, config, json, resume, device = "auto";
  std::vector<std::string> set;
  uint64_t seed = 0;
  bool seed_given = false, out_given = false;
  int threads = 0;
  double time_limit = 0;
  bool print_defaults = false;
};

/// The options of `verb`; `a` must outlive it.
void add_reduced_options(const Command& verb, ReducedArguments& a, const std::string& device_meaning);

/// Throws ConfigError where settings are given for a run that goes on, or data is named nowhere (`recipe` makes some);
/// InputError where it is no run; as check_run_outputs(). Sets the run folder and the data of such a run.
void check_reduced_arguments(ReducedArguments& a, const std::string& recipe);

/// Settings of a new run, or those of the run that goes on.
template <typename Config>
Config reduced_config(const ReducedArguments& a) {
  std::vector<std::string> overrides = a.set;
  if (a.seed_given) overrides.push_back("seed=" + std::to_string(a.seed));
  const std::string file = a.resume.empty() ? a.config : a.out + "/config.json";
  return io::read_config<Config>(file.empty() ? "{}" : read_file(file), file.empty() ? "command line" : file,
                                 overrides);
}

std::map<std::string, std::string> provenance_of(const ReducedArguments& a, const std::string& command_line,
                                                 const std::string& config_json);

/// All of a run of networks but its settings; `log` must outlive it.
void fill_run_options(const ReducedArguments& a, const std::string& command_line, const std::string& config_json,
                      RunLog& log, StageRunOptions& options);
/// Exit code of a run that was stopped, which it tells.
int stopped_run(const StageRunOptions& options, const std::string& verb);

nlohmann::ordered_json json_of(const CalibrationReport& calibration);

/// The model, what the training tells and `seconds` of all its parts, in the run folder.
void write_reduced_result(const ReducedArguments& a, rom::ReducedModel& model, const nlohmann::ordered_json& facts,
                          double seconds, Device device, nn::DType modes);

}  // namespace graupel::train
