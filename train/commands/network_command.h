// graupel-train hgn and gns: parse the command line, train or evaluate a graph network.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/system/command_line.h"
#include "train/config/network_config.h"
#include "train/loop/evaluation.h"
#include "train/parallel/comm.h"

namespace graupel::train {

/// The words of the command line.
struct NetworkArguments {
  Architecture architecture = Architecture::hgn;
  std::string data, out, config, from, teacher, resume, evaluate, split = "test", device = "auto",
                                                                  preset = "recommended", json;
  std::vector<std::string> set;
  int64_t steps = 0, stop_step = 0, stride = 1;
  double minutes = 0, rank_timeout = CommOptions().timeout;
  uint64_t seed = 0;
  int threads = 0, slurm_ranks = 0;
  bool print_defaults = false;
  bool seed_given = false, preset_given = false, split_given = false, stride_given = false;
  std::string command_line;
};

/// Whether there are words for a new run.
bool says_how_to_train(const NetworkArguments& arguments);

nlohmann::ordered_json json_of(const OneStepErrors& errors);
/// Prints the one-step errors of weights on a split and writes them as JSON.
void evaluate_network(const NetworkArguments& arguments);

/// Adds both subcommands; their callbacks set `exit_code`.
void add_network_commands(const Command& app, const std::string& command_line, int& exit_code);

}  // namespace graupel::train
