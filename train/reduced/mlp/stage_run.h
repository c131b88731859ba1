// The run folder of a training whose stages each train one network: checkpoints, metrics, stop and resume, a time
// limit.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/system/file_lock.h"
#include "core/system/stopwatch.h"
#include "train/loop/checkpoint.h"
#include "train/loop/metrics_log.h"
#include "train/loop/training_loop.h"
#include "train/reduced/mlp/mlp_batches.h"
#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

struct StageRunOptions {
  std::string data;     ///< folder of the data set; its train.h5 is read
  std::string run;      ///< run folder (train/loop/run_folder.h)
  bool resume = false;  ///< go on from the newest sound checkpoint; the settings must be the run's
  Device device = Device::cpu;
  int threads = 1;
  double time_limit = 0;  ///< [s] of the whole run, divided among the stages as their epochs are; 0: none
  int64_t stop_step = 0;  ///< stop after this step of the run; 0: do not
  std::string command_line, version;
  std::function<void(const std::string&)> message = {};
  std::function<bool()> should_stop = {};
  std::map<std::string, std::string> provenance = {};  ///< kept in the weights' metadata
};

/// How a stage is trained.
struct StagePlan {
  int64_t steps = 0;
  double seconds = 0;                          ///< limit of the stage; 0: none
  std::function<double(double)> rate_at = {};  ///< learning rate after a share of the stage
  int64_t log_interval = 0, checkpoint_interval = 0;
  const char* rate_key = "";  ///< of the settings, for errors
};

/// Where a stage stands.
struct StageProgress {
  int64_t step = 0;
  double seconds = 0;  ///< of training, earlier parts of the run included
  double loss = 0;     ///< since the last line of the log; 0 in a stage that an earlier part of the run finished
};

class StageRun {
 public:
  /// Makes the run folder, or reads the newest checkpoint. `names`: of the stages; `data_hash`: SnapshotSet::hash();
  /// `options` must outlive this. Throws ConfigError for a folder that holds a run already, or a checkpoint of other
  /// settings or data, whose latents mean something else.
  StageRun(const StageRunOptions& options, std::string config_text, uint64_t seed, std::vector<std::string> names,
           const std::string& data_hash);

  /// Goes on with a stage from where the checkpoint has it, to its end; nothing when it was stopped. Stages are trained
  /// in their order. Throws DivergedError when the loss is no longer a number.
  std::optional<StageProgress> train(int stage, MlpModule& module, MlpBatches& batches, const StagePlan& plan);
  StopReason reason() const { return reason_; }
  double seconds() const { return state_.seconds + watch_.seconds(); }  ///< of all parts of the run
  void say(const std::string& text) const;

 private:
  void restore();
  void restore(MlpModule& module);
  bool go_on(MlpModule& module, MlpBatches& batches, const StagePlan& plan);
  bool stop_asked();
  void log(MlpModule& module, const StagePlan& plan, double share);
  void save(const MlpModule& module);
  const std::string& name() const { return names_[static_cast<std::size_t>(stage_)]; }

  const StageRunOptions& options_;
  std::vector<std::string> names_;
  FileLock lock_;          ///< on the run folder
  CheckpointState state_;  ///< `seconds` is that of the run's earlier parts
  std::map<std::string, nn::Weights> restored_;
  int restored_stage_ = -1;
  std::map<std::string, nn::Weights> finished_;  ///< weights of the stages before
  std::optional<MetricsLog> metrics_;
  Stopwatch watch_;
  int stage_ = 0;
  StageProgress progress_, logged_;
  StopReason reason_ = StopReason::finished;
};

}  // namespace graupel::train
