// The folder of a training run: config.json (every setting), run.json (data, machine, versions), command.txt, log.txt,
// normalization.safetensors, metrics, checkpoints/ and, at the end, weights.safetensors.
#pragma once

#include <string>
#include <vector>

#include "core/system/file_lock.h"
#include "graph/config/hgn_config.h"
#include "nn/offline_cost.h"
#include "train/config/train_config.h"

namespace graupel::train {

/// What run.json keeps.
struct RunFacts {
  std::string data;  ///< folder of the data set, absolute
  std::string device;
  std::string torch;
  std::string version;            ///< of Graupel
  int threads = 0;                ///< of each rank
  int ranks = 1;                  ///< processes that the run was started with
  nn::OfflineCost start = {};     ///< of the weights that it starts from and of its teacher; none without them
  std::string from = {};          ///< weights file that it starts from, absolute; "": fresh weights
  std::string from_hash = {};     ///< file_hash() of it
  std::string teacher = {};       ///< weights file, absolute; "": none
  std::string teacher_hash = {};  ///< file_hash() of it
  std::string data_hash = {};     ///< fingerprint of the training split; "" in runs of before there was one
  double time_limit = 0;          ///< of a reduced model's networks [s]; 0: none
};

/// Settings from JSON text (comments allowed) and "key.path=value" overrides. Throws ConfigError.
TrainConfig read_train_config(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides = {});
/// Every setting as commented JSON.
std::string train_config_text(const TrainConfig& config);
/// Short fingerprint of all settings.
std::string config_hash(const TrainConfig& config);
std::string config_hash(const std::string& config_json);
/// That of the settings that a run's config.json names: the one of the checkpoints of runs that began before there were
/// further settings, too.
std::string run_config_hash(const std::string& folder);

/// Throws ConfigError when the folder holds a run already, of whatever kind.
void check_new_run(const std::string& folder);
/// Makes the folder where it is missing, and keeps others from training in it. Throws ConfigError where one does.
FileLock lock_run(const std::string& folder);
/// Makes the folder of a new run; as check_new_run().
void create_run(const std::string& folder, const TrainConfig& config, const RunFacts& facts,
                const std::string& command_line);
/// The same with the text of config.json.
void create_run(const std::string& folder, const std::string& config_text, const RunFacts& facts,
                const std::string& command_line);
/// Settings and facts of an existing run. Throws InputError when `folder` is none.
TrainConfig read_run_config(const std::string& folder);
RunFacts read_run_facts(const std::string& folder);
bool began_with_other_data(const RunFacts& facts, const std::string& data_hash);
/// The run of a network of `architecture` below `folder` that was written to last. Throws InputError when there is
/// none.
std::string latest_run(const std::string& folder, Architecture architecture);

void write_run_normalization(const std::string& folder, const graph::Normalization& normalization);
graph::Normalization read_run_normalization(const std::string& folder);

inline std::string checkpoint_folder(const std::string& run) { return run + "/checkpoints"; }

}  // namespace graupel::train
