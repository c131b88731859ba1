// Checkpoints of a training run: one folder a step with the four state arrays as safetensors and state.json, which
// holds each file's checksum. Written aside, synced and renamed; a damaged one is recognised when it is read.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "nn/weights.h"

namespace graupel::train {

/// Where a run stands. The data position is the step: batch k depends on (seed, k) alone.
struct CheckpointState {
  int64_t step = 0;
  uint64_t seed = 0;
  std::string config_hash;
  double seconds = 0;  ///< of training so far
  double loss_average = 0;
  double best_validation = -1;  ///< lowest normalised one-step error; -1: none yet
  int64_t best_step = -1;
};

struct Checkpoint {
  CheckpointState state;
  std::map<std::string, nn::Weights> arrays;  ///< by file name without ending: weights, ema, adam_m, adam_v
};

/// Writes `<folder>/step-00001000`. Throws IoError.
void write_checkpoint(const std::string& folder, const Checkpoint& checkpoint);

/// Reads one checkpoint. Throws InputError when a file is missing or does not have the recorded checksum.
Checkpoint read_checkpoint(const std::string& path);

/// The newest sound checkpoint of a folder; `warn` gets a message for each damaged one that was passed over.
/// Throws InputError when there are checkpoints and all are damaged; empty when there is none.
std::optional<Checkpoint> read_latest_checkpoint(const std::string& folder,
                                                 const std::function<void(const std::string&)>& warn);

/// The same, for a run that goes on: `say` gets these messages too, and one where there is no checkpoint yet. Throws
/// ConfigError for a checkpoint of other settings than `config_hash`.
std::optional<Checkpoint> checkpoint_to_resume(const std::string& folder, const std::string& config_hash,
                                               const std::function<void(const std::string&)>& say);

/// Removes all but the newest two and that of `best_step`.
void prune_checkpoints(const std::string& folder, int64_t best_step);

}  // namespace graupel::train
