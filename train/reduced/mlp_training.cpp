#include "train/reduced/mlp_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/stopwatch.h"
#include "io/config/config_description.h"
#include "rom/fields/mlp_fields.h"
#include "train/loop/checkpoint.h"
#include "train/loop/metrics_log.h"
#include "train/loop/run_folder.h"
#include "train/reduced/mlp/mlp_batches.h"
#include "train/reduced/mlp_sweep.h"

namespace graupel::train {

namespace {

class MlpTraining {
 public:
  MlpTraining(const MlpTrainingOptions& options, MlpReport& report)
      : options_(options),
        config_(options.config.mlp),
        report_(report),
        sweep_(options.data, options.config, options.message),
        config_text_(io::write_json(io::json_of_struct(options.config), io::JsonLayout::compact)) {
    const SnapshotSet& set = sweep_.snapshots().set();
    report_.snapshots = set.snapshots();
    if (!options_.resume)
      create_run(options_.run, config_text_ + "\n",
                 {std::filesystem::absolute(options_.data).lexically_normal(), name_of(options_.device),
                  torch_version(), options_.version, options_.threads},
                 options_.command_line);
    state_.seed = options_.config.seed;
    state_.config_hash = config_hash(config_text_);
    if (options_.resume) restore();
    metrics_.emplace(
        options_.run,
        std::vector<std::string>{"stage", "stage_step", "seconds", "loss", "learning_rate", "steps_per_second"},
        state_.step);
    say(fmt::format("{} runs, {} snapshots of {} particles", set.runs(), set.snapshots(), set.particles()));
  }

  std::optional<rom::ReducedModel> run() {
    report_.stages.clear();
    sweep_.snapshots().choose_cluster_points(options_.message);
    for (stage_ = 0; stage_ < mlp_stage_count; ++stage_) {
      MlpStage stage = prepare();
      if (restored_stage_ <= stage_) {
        const bool finished = train(stage);
        save(stage);
        report_.reason = reason_;
        if (!finished) return std::nullopt;
      }
      finish(stage);
    }
    rom::ReducedModel model;
    model.fields = std::make_shared<const rom::MlpFields>(static_cast<int>(options_.config.latents), sweep_.reference(),
                                                          networks_[0], networks_[1], networks_[2]);
    model.conv_encoder = encoder_;
    model.affine_kind = rom::AffineKind::position;
    model.provenance = options_.provenance;
    sweep_.describe(model);
    report_.read_seconds = sweep_.snapshots().read_seconds();
    report_.run_seconds = seconds();
    return model;
  }

 private:
  void say(const std::string& text) const {
    if (options_.message) options_.message(text);
  }
  const MlpStageKind& kind() const { return mlp_stage_kinds[stage_]; }

  void restore() {
    const auto checkpoint = checkpoint_to_resume(checkpoint_folder(options_.run), state_.config_hash,
                                                 [this](const std::string& text) { say(text); });
    if (!checkpoint) return;
    state_ = checkpoint->state;
    restored_ = checkpoint->arrays;
    const auto& facts = restored_.at("stage").metadata;
    restored_stage_ = std::stoi(facts.at("stage"));
    say(fmt::format("resumed at step {} ({}, step {})", state_.step, mlp_stage_kinds[restored_stage_].name,
                    facts.at("step")));
  }

  /// The stage's network with its data on the device, and as far as it was trained already.
  MlpStage prepare() {
    MlpStage stage = sweep_.prepare(stage_, options_.device);
    report_.latent_tail = sweep_.latent_tail();
    if (restored_stage_ > stage_) stage.module->set_state(MlpArray::weights, restored_.at(kind().name));
    if (restored_stage_ == stage_) {
      for (const MlpArray array : all_mlp_arrays) stage.module->set_state(array, restored_.at(name_of(array)));
      const auto& facts = restored_.at("stage").metadata;
      stage.step = std::stoll(facts.at("step"));
      stage.seconds = std::stod(facts.at("seconds"));
    }
    return stage;
  }

  int64_t steps_of(const MlpBatches& batches) const {
    const auto epochs = static_cast<double>(stage_ == 0 ? config_.deformation_epochs : config_.field_epochs);
    return std::max<int64_t>(1, std::llround(5 * epochs * config_.epochs_scale * batches.steps_per_epoch()));
  }
  /// [s]; 0: no limit.
  double seconds_of_stage() const {
    const auto g = static_cast<double>(config_.deformation_epochs), other = static_cast<double>(config_.field_epochs);
    return options_.time_limit * (stage_ == 0 ? g : other) / (g + 2 * other);
  }

  /// Whether the stage came to its end.
  bool train(MlpStage& stage) {
    MlpBatches batches(options_.config.seed, stage_, sweep_.snapshots().set().snapshots(), stage.points,
                       config_.batch_snapshots, config_.batch_particles);
    const int64_t steps = steps_of(batches);
    const double limit = seconds_of_stage(), before = stage.seconds;
    say(fmt::format("{}: width {}, {} steps", kind().name, stage.shape.width, steps));
    const Stopwatch watch;
    logged_step_ = stage.step;
    logged_seconds_ = stage.seconds;
    while (stage.step < steps) {
      stage.seconds = before + watch.seconds();
      double progress = static_cast<double>(stage.step) / static_cast<double>(steps);
      if (limit > 0) progress = std::max(progress, stage.seconds / limit);
      if (progress >= 1) break;
      stage.module->train_step(batches.batch(stage.step), config_.rate_at(progress), stage.step + 1);
      ++stage.step;
      ++state_.step;
      if (stage.step % config_.log_interval == 0 || stage.step == steps) log(stage, steps, progress);
      if (stage.step % config_.checkpoint_interval == 0) save(stage);
      if (stop_asked()) return false;
    }
    if (stage.step > logged_step_) log(stage, steps, 1);
    return true;
  }

  bool stop_asked() {
    if (options_.should_stop && options_.should_stop())
      reason_ = StopReason::stopped;
    else if (options_.stop_step > 0 && state_.step >= options_.stop_step)
      reason_ = StopReason::reached_stop_step;
    else
      return false;
    return true;
  }

  void log(MlpStage& stage, int64_t steps, double progress) {
    loss_ = stage.module->take_loss();
    if (!std::isfinite(loss_))
      throw DivergedError(fmt::format(
          "training diverged (the loss of the {} is no longer a number by its step {}). Lower mlp.learning_rate and "
          "start a new run; checkpoints of this one remain",
          kind().name, stage.step));
    const double rate = config_.rate_at(progress), lap = std::max(stage.seconds - logged_seconds_, 1e-9),
                 speed = static_cast<double>(stage.step - logged_step_) / lap;
    metrics_->write(state_.step, {{"stage", stage_},
                                  {"stage_step", static_cast<double>(stage.step)},
                                  {"seconds", seconds()},
                                  {"loss", loss_},
                                  {"learning_rate", rate},
                                  {"steps_per_second", speed}});
    double left = static_cast<double>(steps - stage.step) / speed;
    if (const double limit = seconds_of_stage(); limit > 0) left = std::min(left, limit - stage.seconds);
    say(fmt::format("{} {}/{}  loss {:.4g}  rate {:.2g}  {:.1f} it/s  {} left", kind().name, stage.step, steps, loss_,
                    rate, speed, human_time(std::max(left, 0.0))));
    logged_step_ = stage.step;
    logged_seconds_ = stage.seconds;
  }

  double seconds() const { return state_.seconds + watch_.seconds(); }

  /// The current stage's arrays, and the weights of those before.
  void save(const MlpStage& stage) {
    Checkpoint checkpoint{state_, {}};
    checkpoint.state.seconds = seconds();
    for (const MlpArray array : all_mlp_arrays) checkpoint.arrays[name_of(array)] = stage.module->state(array);
    for (int s = 0; s < stage_; ++s) checkpoint.arrays[mlp_stage_kinds[s].name] = finished_[s];
    nn::Weights facts;
    facts.metadata = {{"stage", std::to_string(stage_)},
                      {"step", std::to_string(stage.step)},
                      {"seconds", fmt::format("{}", stage.seconds)}};
    checkpoint.arrays["stage"] = facts;
    write_checkpoint(checkpoint_folder(options_.run), checkpoint);
    prune_checkpoints(checkpoint_folder(options_.run), -1);
  }

  void finish(const MlpStage& stage) {
    const nn::Weights weights = stage.module->state(MlpArray::weights);
    finished_[stage_] = weights;
    networks_[stage_] = stage.network(weights);
    if (stage_ == 0) encoder_ = sweep_.take_encoder(stage, weights);
    const double error = error_of(stage);
    report_.stages.push_back(
        {kind().name, stage.shape.width, stage.step, stage.seconds, restored_stage_ > stage_ ? 0 : loss_, error});
    say(fmt::format("{}: {} steps in {}, error {:.3g} % of the deviation from the mean", kind().name, stage.step,
                    human_time(stage.seconds), 100 * error));
  }

  /// Over 64 snapshots spread over the training, all points.
  double error_of(const MlpStage& stage) const {
    const int64_t count = sweep_.snapshots().set().snapshots(), step = std::max<int64_t>(1, count / 64);
    MlpBatch batch;
    batch.points.resize(static_cast<std::size_t>(stage.points));
    std::iota(batch.points.begin(), batch.points.end(), int64_t{0});
    MlpModule::Squares sum;
    for (int64_t i = step / 2; i < count; i += step) {
      batch.snapshots = {i};
      const MlpModule::Squares part = stage.module->squares(batch);
      sum.error += part.error;
      sum.target += part.target;
    }
    return sum.target > 0 ? std::sqrt(sum.error / sum.target) : 0;
  }

  const MlpTrainingOptions& options_;
  const MlpConfig& config_;
  MlpReport& report_;
  MlpSweep sweep_;
  std::string config_text_;
  CheckpointState state_;  ///< `seconds` is that of the run's earlier parts
  std::map<std::string, nn::Weights> restored_;
  int restored_stage_ = -1;
  std::optional<MetricsLog> metrics_;
  Stopwatch watch_;
  int stage_ = 0;
  int64_t logged_step_ = 0;
  double logged_seconds_ = 0, loss_ = 0;
  StopReason reason_ = StopReason::finished;
  nn::Weights finished_[mlp_stage_count];
  rom::Mlp networks_[mlp_stage_count];
  std::optional<rom::ConvEncoder> encoder_;
};

}  // namespace

std::optional<rom::ReducedModel> train_mlp(const MlpTrainingOptions& options, MlpReport& report) {
  const Stopwatch watch;
  configure_torch(options.threads, options.config.mlp.tf32);
  std::optional<rom::ReducedModel> model = MlpTraining(options, report).run();
  report.seconds = watch.seconds();
  return model;
}

}  // namespace graupel::train
