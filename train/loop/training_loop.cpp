#include "train/loop/training_loop.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <utility>

#include "core/parallel/hardware.h"
#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "graph/features/normalization.h"
#include "train/data/sampling.h"
#include "train/loop/checkpoint.h"
#include "train/loop/metrics_log.h"
#include "train/loop/provenance.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_cost.h"
#include "train/loop/training_steps.h"
#include "train/networks/initial_weights.h"

namespace graupel::train {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Whether weights are those of a teacher, or have learned from them: then their cost has the teacher's already.
bool has_learned_from(const std::string& file, const std::string& teacher_hash) {
  if (file_hash(file) == teacher_hash) return true;
  const auto metadata = nn::read_safetensors(file).metadata;
  const auto found = metadata.find("training.teacher_hash");
  return found != metadata.end() && found->second == teacher_hash;
}

nn::OfflineCost cost_of(const std::string& file) {
  return nn::offline_cost_of(nn::read_safetensors(file).metadata, file);
}

/// Steps between two agreements of several ranks on whether to stop; on a GPU each waits until the GPU is done.
int64_t agreement_interval(Device device) { return device == Device::cuda ? 10 : 1; }

const std::vector<std::string>& metric_columns() {
  static const std::vector<std::string> columns = {"seconds",
                                                   "loss",
                                                   "learning_rate",
                                                   "gradient_norm",
                                                   "scenes_per_second",
                                                   "valid_one_step_normalized",
                                                   "valid_one_step_raw",
                                                   "valid_zero_raw",
                                                   "valid_ballistic_raw",
                                                   "valid_rollout_mse"};
  return columns;
}

class TrainingRun {
 public:
  explicit TrainingRun(const TrainingOptions& options);
  TrainingResult execute();

 private:
  void say(const std::string& text) const {
    if (options_.message && comm_.leads()) options_.message(text);
  }
  void check_same_start() const;
  void begin_run();
  /// Of which samples of `bundle` frames are drawn, after `push_steps` bundles of the network's own.
  std::unique_ptr<DataSplit> open(const std::string& name, int64_t bundle, int64_t push_steps) const;
  void prepare_normalization(bool at_start);
  void start_from_weights(const std::string& from);
  nn::OfflineCost cost_of_start() const;
  /// False where there is no checkpoint yet.
  bool restore();
  std::unique_ptr<TrainingSteps> make_steps();
  StopReason train(TrainingSteps& steps);
  void look_at_clock();
  StepSettings step_settings() const;
  /// What follows a step; whether and why to stop.
  std::optional<StopReason> after_step();
  void report();
  void validate();
  void take_means();
  void save_checkpoint();
  std::string export_weights() const;
  double seconds() const { return state_.seconds + seconds_since(start_); }
  std::optional<StopReason> stop_reason();
  bool any_rank(bool own);
  EvaluationOptions evaluation() const {
    return {StateArray::ema, config_.batch_scenes, std::max(1, options_.threads - 1), options_.should_stop};
  }

  const TrainingOptions& options_;
  const TrainConfig& config_;
  Comm& comm_;
  std::unique_ptr<Teacher> teacher_;          ///< may be null
  std::unique_ptr<DataSplit> train_, valid_;  ///< valid_ may be null
  graph::Normalization normalization_;
  NetworkModule module_;
  CheckpointState state_;  ///< `seconds` is that of the run's earlier parts
  int64_t saved_step_ = -1;
  double schedule_share_ = 0;  ///< of schedule_minutes that has passed
  StepMeans means_;            ///< since the last report
  std::optional<Validation> validation_;
  std::optional<FileLock> lock_;       ///< of rank 0, on the run folder
  std::optional<MetricsLog> metrics_;  ///< of rank 0
  Clock::time_point start_, last_report_;
};

TrainingRun::TrainingRun(const TrainingOptions& options)
    : options_(options),
      config_(options.config),
      comm_(*options.comm),
      teacher_(read_teacher(options.teacher, config_, options.device)),
      module_(config_.network(), options.device, config_.seed,
              config_.mixed_precision ? NumberType::mixed : NumberType::f32, config_.checkpoint_layers) {
  check_rank_count(comm_.size(), config_);
  check_equal_teachers(comm_, teacher_.get());
  train_ = open("train.h5", config_.features().bundle, config_.push_steps);
  state_.seed = config_.seed;
  if (comm_.leads()) begin_run();
  broadcast_value(comm_, normalization_);
  broadcast_value(comm_, state_.step);
  module_.share_state(comm_);
}

/// The same teacher; other data are said alone, as more or better ones may be meant.
void TrainingRun::check_same_start() const {
  const RunFacts facts = read_run_facts(options_.run);
  if (began_with_other_data(facts, train_->hash()))
    say("WARNING: '" + options_.data + "' is not the data that the run began with, whose normalisation it keeps");
  if (facts.teacher_hash == (teacher_ ? teacher_->hash : "")) return;
  const auto named = [](const std::string& file) { return file.empty() ? "none" : "'" + file + "'"; };
  throw ConfigError("'" + options_.run + "' began with another teacher (" + named(facts.teacher) + ", here " +
                    named(options_.teacher) + ", or its bytes have changed). Resume it with the same file");
}

/// What rank 0 does alone: the run folder, the normalisation, the checkpoint to go on from.
void TrainingRun::begin_run() {
  if (fs::exists(options_.data + "/valid.h5"))
    valid_ = open("valid.h5", 1, 0);
  else
    say("'" + options_.data + "' has no valid.h5: training without validation");
  if (!options_.resume && !options_.from.empty()) starting_weights(options_.from, config_.network());  // throws
  lock_.emplace(lock_run(options_.run));
  if (!options_.resume)
    create_run(options_.run, config_,
               {fs::absolute(options_.data).lexically_normal(), name_of(options_.device), torch_version(),
                options_.version, options_.threads, comm_.size(), cost_of_start(),
                options_.from.empty() ? "" : fs::absolute(options_.from).lexically_normal().string(),
                options_.from.empty() ? "" : file_hash(options_.from),
                teacher_ ? fs::absolute(teacher_->file).lexically_normal().string() : "",
                teacher_ ? teacher_->hash : "", train_->hash()},
               options_.command_line);
  else
    check_same_start();
  state_.config_hash = config_hash(config_);
  if (options_.resume && config_hash(read_run_config(options_.run)) == state_.config_hash)
    state_.config_hash = run_config_hash(options_.run);
  if (teacher_) say("learns from '" + teacher_->file + "'");
  const bool goes_on = options_.resume && restore();
  prepare_normalization(!goes_on);
  metrics_.emplace(options_.run, metric_columns(), state_.step);
}

std::unique_ptr<DataSplit> TrainingRun::open(const std::string& name, int64_t bundle, int64_t push_steps) const {
  DataSplitOptions split;
  split.memory_limit = config_.memory_limit * 1e9;
  split.processes = options_.local_ranks;
  split.threads = options_.threads;
  split.materials =
      config_.features().material_constants || (teacher_ && teacher_->config.features().material_constants);
  split.check = [&](const DataSplit& opened) {
    opened.check_fits(config_.network());
    if (teacher_) opened.check_fits(teacher_->config.network(), teacher_->file);
    opened.check_samples(bundle, push_steps);
  };
  auto last = Clock::now();
  split.progress = [&](const std::string& what, int64_t done, int64_t total) {
    if (done < total && seconds_since(last) < 10) return;
    last = Clock::now();
    say(name + ": " + what + " " + std::to_string(done) + "/" + std::to_string(total));
  };
  return std::make_unique<DataSplit>(options_.data + "/" + name, split);
}

/// Of a run without a checkpoint (`at_start`) also the weights that it starts from: it may have been killed before its
/// first one.
void TrainingRun::prepare_normalization(bool at_start) {
  const RunFacts facts = read_run_facts(options_.run);
  const std::string file = options_.run + "/normalization.safetensors";
  const bool is_stored = options_.resume && fs::exists(file);
  if (at_start && !facts.from.empty()) {
    if (file_hash(facts.from) != facts.from_hash)
      throw ConfigError("'" + options_.run +
                        "' has no checkpoint yet, and the bytes of the weights that it began with ('" + facts.from +
                        "') have changed. Put them back, or start a new run");
    start_from_weights(facts.from);
  } else if (is_stored) {
    normalization_ = read_run_normalization(options_.run);
    return;
  } else if (!facts.from.empty()) {
    throw InputError("'" + file +
                     "' is not there, which the weights of the checkpoints go with. Put it back, or start "
                     "a new run");
  } else {
    normalization_ = train_->statistics(config_.noise_std, options_.threads);
  }
  write_run_normalization(options_.run, normalization_);
}

void TrainingRun::start_from_weights(const std::string& from) {
  const nn::Weights weights = starting_weights(from, config_.network());
  // What the weights mean depends on the statistics that they were trained with.
  normalization_ = graph::read_normalization(weights);
  for (const StateArray array : {StateArray::weights, StateArray::ema}) module_.set_state(array, weights);
  say("starts from '" + from + "'");
}

/// Of the weights that the run starts from, and of the teacher.
nn::OfflineCost TrainingRun::cost_of_start() const {
  nn::OfflineCost cost;
  if (!options_.from.empty()) cost = cost_of(options_.from);
  if (!teacher_ || (!options_.from.empty() && has_learned_from(options_.from, teacher_->hash))) return cost;
  const nn::OfflineCost of_teacher = cost_of(teacher_->file);
  cost.add_data(of_teacher.data);
  cost.training.insert(cost.training.end(), of_teacher.training.begin(), of_teacher.training.end());
  return cost;
}

bool TrainingRun::restore() {
  const auto checkpoint = checkpoint_to_resume(checkpoint_folder(options_.run), state_.config_hash,
                                               [this](const std::string& text) { say(text); });
  if (!checkpoint) return false;
  state_ = checkpoint->state;
  saved_step_ = state_.step;
  for (const StateArray array : all_state_arrays) module_.set_state(array, checkpoint->arrays.at(name_of(array)));
  say("resumed at step " + std::to_string(state_.step) +
      (comm_.alone() ? "" : " on " + std::to_string(comm_.size()) + " ranks"));
  return true;
}

std::unique_ptr<TrainingSteps> TrainingRun::make_steps() {
  return make_training_steps(
      {*train_, config_, normalization_, teacher_.get(), module_, comm_, options_.device, options_.threads},
      state_.step, [this](const std::string& text) { say(text); });
}

StopReason TrainingRun::train(TrainingSteps& steps) {
  while (state_.step < config_.steps) {
    look_at_clock();
    if (schedule_share_ >= 1) break;
    steps.take(step_settings());
    if (const auto stop = after_step()) return *stop;
  }
  return StopReason::finished;
}

/// All ranks go by the clock of the first one, or their weights would part.
void TrainingRun::look_at_clock() {
  if (!(config_.schedule_minutes > 0)) return;
  const double share = seconds() / (60 * config_.schedule_minutes);
  if (comm_.alone())
    schedule_share_ = share;
  else if (state_.step % agreement_interval(options_.device) == 0)
    schedule_share_ = sum_over_ranks(comm_, {comm_.leads() ? share : 0.0}).front();
}

std::optional<StopReason> TrainingRun::after_step() {
  ++state_.step;
  if (state_.step % config_.log_interval == 0 || state_.step == config_.steps) report();
  if (state_.step % config_.validation_interval == 0) validate();
  if (state_.step % config_.checkpoint_interval == 0) {
    module_.share_state(comm_);  // ranks whose machines or threads round otherwise do not drift apart
    take_means();
    save_checkpoint();
  }
  return stop_reason();
}

TrainingResult TrainingRun::execute() {
  const StopPolicyScope saves_first(StopPolicy::finish);
  start_ = last_report_ = Clock::now();
  const std::unique_ptr<TrainingSteps> steps = make_steps();
  StopReason reason = StopReason::finished;
  try {
    reason = train(*steps);
  } catch (const CommError&) {
    save_checkpoint();  // the state of the last whole step
    throw;
  } catch (const GpuMemoryError& error) {
    save_checkpoint();
    if (!comm_.leads()) throw;
    throw GpuMemoryError(std::string(error.what()) + ". A new run goes on with --from " + export_weights());
  }
  take_means();
  // A signal leaves little time: the state is saved, nothing more is measured.
  const bool measured = validation_ && validation_->step == state_.step;
  if (reason != StopReason::stopped && !measured) validate();
  save_checkpoint();
  TrainingResult result;
  if (comm_.leads()) result.weights_file = export_weights();
  comm_.barrier();  // launchers take the first rank that ends for the end of all
  result.reason = reason;
  result.step = state_.step;
  result.scene_samples = state_.step * config_.batch_scenes;
  result.seconds = seconds();
  result.loss_average = state_.loss_average;
  result.parameters = module_.parameter_count();
  result.best_validation = state_.best_validation;
  result.best_step = state_.best_step;
  result.validation = validation_;
  return result;
}

StepSettings TrainingRun::step_settings() const {
  StepSettings settings;
  settings.learning_rate = config_.rate_at(state_.step, schedule_share_);
  settings.clip_norm = config_.clip_norm;
  settings.ema_decay = config_.ema_decay_at(state_.step);
  settings.step = state_.step + 1;
  return settings;
}

/// Adds the steps since the last call to means_; throws where they have diverged, before a checkpoint of them is
/// written. On every rank, as their means are equal.
void TrainingRun::take_means() {
  const StepMeans later = module_.take_means();
  if (later.steps == 0) return;
  if (!std::isfinite(later.loss) || !std::isfinite(later.gradient_norm))
    throw DivergedError("training diverged (the loss is no longer a number by step " + std::to_string(state_.step) +
                        "). Lower learning_rate or clip_norm and start a new run; checkpoints of this one remain");
  const double share = static_cast<double>(later.steps) / static_cast<double>(means_.steps + later.steps);
  means_.loss += share * (later.loss - means_.loss);
  means_.gradient_norm += share * (later.gradient_norm - means_.gradient_norm);
  means_.steps += later.steps;
}

void TrainingRun::report() {
  take_means();
  const StepMeans means = std::exchange(means_, {});
  if (!comm_.leads()) return;
  state_.loss_average = state_.loss_average == 0 ? means.loss : 0.9 * state_.loss_average + 0.1 * means.loss;
  TrainingProgress progress;
  progress.step = state_.step;
  progress.steps = config_.steps;
  progress.loss = means.loss;
  progress.loss_average = state_.loss_average;
  progress.learning_rate = config_.rate_at(state_.step, schedule_share_);
  progress.steps_per_second = static_cast<double>(means.steps) / std::max(seconds_since(last_report_), 1e-9);
  progress.scenes_per_second = progress.steps_per_second * static_cast<double>(config_.batch_scenes);
  progress.seconds_left = static_cast<double>(config_.steps - state_.step) / std::max(progress.steps_per_second, 1e-9);
  last_report_ = Clock::now();
  metrics_->write(state_.step, {{"seconds", seconds()},
                                {"loss", means.loss},
                                {"learning_rate", progress.learning_rate},
                                {"gradient_norm", means.gradient_norm},
                                {"scenes_per_second", progress.scenes_per_second}});
  if (options_.progress) options_.progress(progress);
}

void TrainingRun::validate() {
  if (!valid_) return;
  const auto begin = Clock::now();
  Validation validation;
  validation.step = state_.step;
  validation.one_step = evaluate_one_step(module_, normalization_, *valid_,
                                          spread_samples(*valid_, config_.validation_samples), evaluation());
  if (config_.rollout_scenes > 0)
    validation.rollout_mse = evaluate_rollout(module_, normalization_, *valid_, config_.rollout_scenes,
                                              config_.rollout_frames, evaluation());
  if (options_.should_stop && options_.should_stop()) return;  // it was cut short
  const SquaredErrors all = validation.one_step.all();
  const double error = all.normalized_mse(Predictor::network);
  validation_ = validation;
  metrics_->write(state_.step, {{"seconds", seconds()},
                                {"valid_one_step_normalized", error},
                                {"valid_one_step_raw", all.raw_mse(Predictor::network)},
                                {"valid_zero_raw", all.raw_mse(Predictor::zero)},
                                {"valid_ballistic_raw", all.raw_mse(Predictor::ballistic)},
                                {"valid_rollout_mse", validation.rollout_mse}});
  char text[200], rollout[40] = "";
  if (config_.rollout_scenes > 0)
    std::snprintf(rollout, sizeof(rollout), ", rollout MSE %.4g m^2", validation.rollout_mse);
  std::snprintf(text, sizeof(text),
                "step %lld: validation one-step error %.4g (zero acceleration %.4g, ballistic %.4g)%s",
                static_cast<long long>(state_.step), error, all.normalized_mse(Predictor::zero),
                all.normalized_mse(Predictor::ballistic), rollout);
  say(text);
  last_report_ += Clock::now() - begin;  // not part of the training rate
  if (std::isfinite(error) && (state_.best_validation < 0 || error < state_.best_validation)) {
    state_.best_validation = error;
    state_.best_step = state_.step;
    saved_step_ = -1;
    save_checkpoint();
  }
}

void TrainingRun::save_checkpoint() {
  if (!comm_.leads() || saved_step_ == state_.step) return;
  const auto begin = Clock::now();
  Checkpoint checkpoint{state_, {}};
  checkpoint.state.seconds = seconds();
  for (const StateArray array : all_state_arrays) checkpoint.arrays[name_of(array)] = module_.state(array);
  write_checkpoint(checkpoint_folder(options_.run), checkpoint);
  prune_checkpoints(checkpoint_folder(options_.run), state_.best_step);
  saved_step_ = state_.step;
  last_report_ += Clock::now() - begin;
}

std::optional<StopReason> TrainingRun::stop_reason() {
  if (options_.should_stop && any_rank(options_.should_stop())) return StopReason::stopped;
  if (state_.step == config_.steps) return std::nullopt;
  if (options_.minutes > 0 && any_rank(seconds_since(start_) > 60 * options_.minutes)) return StopReason::out_of_time;
  if (options_.stop_step > 0 && state_.step >= options_.stop_step) return StopReason::reached_stop_step;
  return std::nullopt;
}

/// Whether one of the ranks says yes: all of them must stop after the same step.
bool TrainingRun::any_rank(bool own) {
  if (comm_.alone()) return own;
  if (state_.step % agreement_interval(options_.device) != 0) return false;
  return sum_over_ranks(comm_, {own ? 1.0 : 0.0}).front() > 0;
}

std::string TrainingRun::export_weights() const {
  nn::Weights weights = module_.state(StateArray::ema);
  graph::add_normalization(weights, normalization_);
  weights.metadata = metadata_of(config_.network());
  CheckpointState state = state_;
  state.seconds = seconds();
  weights.metadata.merge(training_provenance(options_, state, *train_, validation_, teacher_.get()));
  const nn::OfflineCost cost =
      with_training(read_run_facts(options_.run).start, options_.data, state.seconds * comm_.size(),
                    hardware_name(options_.device, options_.threads));
  weights.metadata[nn::offline_cost_key] = nn::offline_cost_json(cost);
  std::string file = options_.run + "/weights.safetensors";
  nn::write_safetensors(file, weights);
  return file;
}

}  // namespace

void check_rank_count(int ranks, const TrainConfig& config) {
  if (ranks > config.batch_scenes)
    throw ConfigError(std::to_string(ranks) + " ranks are too many for batches of " +
                      std::to_string(config.batch_scenes) +
                      " scenes (each takes one or more). Start fewer, or set batch_scenes higher");
}

const char* name_of(StopReason reason) {
  constexpr const char* names[] = {"finished", "out_of_time", "stopped", "reached_stop_step"};
  return names[static_cast<std::size_t>(reason)];
}

TrainingResult train_network(const TrainingOptions& options) {
  configure_torch(options.threads, options.config.tf32);
  return TrainingRun(options).execute();
}

}  // namespace graupel::train
