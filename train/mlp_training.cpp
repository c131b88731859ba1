#include "train/mlp_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/human_time.h"
#include "io/config_description.h"
#include "rom/mlp_fields.h"
#include "train/checkpoint.h"
#include "train/metrics_log.h"
#include "train/mlp_batches.h"
#include "train/mlp_module.h"
#include "train/nsf_snapshots.h"
#include "train/run_folder.h"
#include "train/stopwatch.h"
#include "train/trained_layers.h"

namespace graupel::train {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int stage_count = 3;
struct StageKind {
  const char* name;
  SnapshotField field;
};
constexpr StageKind stage_kinds[stage_count] = {
    {"deformation", SnapshotField::position}, {"stress", SnapshotField::stress}, {"affine", SnapshotField::affine}};

/// A network and what training keeps of it.
struct Stage {
  MlpShape shape;
  rom::Standardization input, output;
  std::optional<MlpModule> module;
  int64_t step = 0;
  double seconds = 0;  ///< of training, earlier parts of the run included
};

/// Mean and one over the standard deviation of `width` interleaved numbers; 1 where they do not vary.
rom::Standardization standardization_of(const std::vector<float>& values, std::size_t width) {
  std::vector<double> sum(width, 0), sum2(width, 0);
  const auto count = static_cast<double>(values.size() / width);
  for (std::size_t i = 0; i < values.size(); ++i) sum[i % width] += static_cast<double>(values[i]);
  rom::Standardization s;
  for (std::size_t c = 0; c < width; ++c) s.shift.push_back(sum[c] / count);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double d = static_cast<double>(values[i]) - s.shift[i % width];
    sum2[i % width] += d * d;
  }
  for (std::size_t c = 0; c < width; ++c) {
    const double deviation = std::sqrt(sum2[c] / count);
    s.scale.push_back(deviation < 1e-12 ? 1 : 1 / deviation);
  }
  return s;
}

void standardize(std::vector<float>& values, const rom::Standardization& s) {
  const std::size_t width = s.shift.size();
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<float>((static_cast<double>(values[i]) - s.shift[i % width]) * s.scale[i % width]);
}

/// From a network's own numbers back to the field's.
rom::Standardization inverse_scale(rom::Standardization s) {
  for (double& scale : s.scale) scale = 1 / scale;
  return s;
}

rom::Mlp network_of(const Stage& stage, const nn::Weights& weights) {
  return {layers_of(weights, stage.shape), stage.input, inverse_scale(stage.output)};
}

rom::ConvEncoder encoder_of(const Stage& stage, const nn::Weights& weights, rom::Standardization position) {
  using rom::ConvEncoder;
  const std::vector<int64_t> lengths = ConvEncoder::lengths(stage.shape.encoder_particles);
  constexpr int channels = ConvEncoder::channels, kernel = ConvEncoder::kernel, hidden = ConvEncoder::hidden;
  std::vector<rom::MlpLayer> convolutions;
  for (std::size_t l = 0; l + 1 < lengths.size(); ++l)
    convolutions.push_back(layer_of(weights, "encoder.conv" + std::to_string(l), channels, channels * kernel,
                                    {channels, channels, kernel}));
  const int flat = channels * static_cast<int>(lengths.back()), r = stage.shape.latents;
  return {stage.shape.encoder_particles, std::move(convolutions),
          layer_of(weights, "encoder.hidden", hidden, flat, {hidden, flat}),
          layer_of(weights, "encoder.latent", r, hidden, {r, hidden}), std::move(position)};
}

class MlpTraining {
 public:
  MlpTraining(const MlpTrainingOptions& options, MlpReport& report)
      : options_(options),
        config_(options.config.mlp),
        report_(report),
        snapshots_(options.data, options.config),
        config_text_(io::write_json(io::json_of_struct(options.config), io::JsonLayout::compact)) {
    const SnapshotSet& set = snapshots_.set();
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
    snapshots_.fit_quadrature(options_.message);
    for (stage_ = 0; stage_ < stage_count; ++stage_) {
      Stage stage = prepare();
      if (restored_stage_ <= stage_) {
        const bool finished = train(stage);
        save(stage);
        report_.reason = reason_;
        if (!finished) return std::nullopt;
      }
      finish(stage);
    }
    rom::ReducedModel model;
    std::vector<float> reference;
    for (const Vec3f& x : snapshots_.set().reference()) reference.insert(reference.end(), x.a, x.a + 3);
    model.fields = std::make_shared<const rom::MlpFields>(
        static_cast<int>(options_.config.latents), std::move(reference), networks_[0], networks_[1], networks_[2]);
    model.conv_encoder = encoder_;
    model.affine_kind = rom::AffineKind::position;
    model.provenance = options_.provenance;
    snapshots_.describe(latents_, latent_scale(), modes_, model);
    report_.read_seconds = snapshots_.read_seconds();
    return model;
  }

 private:
  void say(const std::string& text) const {
    if (options_.message) options_.message(text);
  }
  const StageKind& kind() const { return stage_kinds[stage_]; }
  bool conv() const { return config_.encoder == EncoderKind::conv; }

  void restore() {
    const auto checkpoint = checkpoint_to_resume(checkpoint_folder(options_.run), state_.config_hash,
                                                 [this](const std::string& text) { say(text); });
    if (!checkpoint) return;
    state_ = checkpoint->state;
    restored_ = checkpoint->arrays;
    const auto& facts = restored_.at("stage").metadata;
    restored_stage_ = std::stoi(facts.at("stage"));
    say(fmt::format("resumed at step {} ({}, step {})", state_.step, stage_kinds[restored_stage_].name,
                    facts.at("step")));
  }

  /// The stage's network with its data on the device.
  Stage prepare() {
    const int r = static_cast<int>(options_.config.latents),
              mu = static_cast<int>(snapshots_.set().parameters().size());
    const int64_t betas[] = {config_.deformation_beta, config_.stress_beta, config_.affine_beta};
    Stage stage;
    stage.shape.latents = r;
    const bool sees_parameters = stage_ == 1 || (stage_ == 2 && config_.affine_input == AffineInput::parameters);
    stage.shape.parameters = sees_parameters ? mu : 0;
    stage.shape.outputs = components_of(kind().field);
    stage.shape.width = config_.width(betas[stage_], stage.shape.outputs);
    if (stage_ == 0 && conv()) stage.shape.encoder_particles = snapshots_.set().particles();
    stage.module.emplace(stage.shape, options_.device, options_.config.seed);
    set_inputs(stage);
    if (stage_ > 0) set_output(stage, snapshots_.read_means(kind().field));
    if (restored_stage_ > stage_) stage.module->set_state(MlpArray::weights, restored_.at(kind().name));
    if (restored_stage_ == stage_) {
      for (const MlpArray array : all_mlp_arrays) stage.module->set_state(array, restored_.at(name_of(array)));
      const auto& facts = restored_.at("stage").metadata;
      stage.step = std::stoll(facts.at("step"));
      stage.seconds = std::stod(facts.at("seconds"));
    }
    return stage;
  }

  /// X of the particles or of the clusters' representatives, and (q, mu) of the snapshots, standardised.
  void set_inputs(Stage& stage) {
    const std::vector<Vec3f>& reference = snapshots_.set().reference();
    std::vector<float> all, points;
    for (const Vec3f& x : reference) all.insert(all.end(), x.a, x.a + 3);
    stage.input = standardization_of(all, 3);
    if (stage_ == 0)
      points = all;
    else
      for (const int32_t p : snapshots_.representatives())
        points.insert(points.end(), reference[static_cast<std::size_t>(p)].a,
                      reference[static_cast<std::size_t>(p)].a + 3);
    standardize(points, stage.input);
    stage.module->set_points(points);
    points_ = static_cast<int64_t>(points.size()) / 3;
    if (stage_ == 0) read_positions(stage);
    stage.input.shift.resize(static_cast<std::size_t>(stage.shape.inputs()), 0.0);
    stage.input.scale.resize(static_cast<std::size_t>(stage.shape.inputs()), 1.0);
    const MatrixXd z = stage_ == 0 && conv() ? MatrixXd() : snapshots_.inputs(latents_);
    const std::vector<SweptParameter>& parameters = snapshots_.set().parameters();
    for (int i = 0; i < stage.shape.parameters; ++i) {
      const std::vector<double>& values = parameters[static_cast<std::size_t>(i)].values;
      const rom::Standardization s = standardization_of({values.begin(), values.end()}, 1);
      stage.input.shift[static_cast<std::size_t>(3 + stage.shape.latents + i)] = s.shift[0];
      stage.input.scale[static_cast<std::size_t>(3 + stage.shape.latents + i)] = s.scale[0];
    }
    std::vector<float> states;
    for (Index i = 0; i < z.rows(); ++i)
      for (Index j = 0; j < stage.shape.latents + stage.shape.parameters; ++j) {
        const auto at = static_cast<std::size_t>(3 + j);
        states.push_back(static_cast<float>((z(i, j) - stage.input.shift[at]) * stage.input.scale[at]));
      }
    if (!states.empty()) stage.module->set_states(states);
  }

  /// Displacements as targets; the latents of the snapshots, or what the encoder finds them from.
  void read_positions(Stage& stage) {
    std::vector<float> position = snapshots_.read(SnapshotField::position);
    const auto row = 3 * snapshots_.set().reference().size();
    if (conv()) {
      position_ = standardization_of(position, 3);
      std::vector<float> channels = position;
      standardize(channels, position_);
      const std::size_t n = row / 3;
      std::vector<float> by_channel(channels.size());
      for (std::size_t i = 0; i < channels.size(); ++i)
        by_channel[i / row * row + i % 3 * n + i % row / 3] = channels[i];
      stage.module->set_encoder_positions(by_channel);
    }
    const auto r = static_cast<Index>(options_.config.latents);
    MatrixBlocks blocks(snapshots_.matrix(position));
    const Pod modes = pod(blocks, static_cast<int>(options_.config.deformation_modes));
    if (modes.modes() < r)
      throw ConfigError(fmt::format(
          "{} latents are more than the modes that the snapshots have ({}). Set latents lower, or train on more runs",
          r, modes.modes()));
    if (!conv()) {
      latents_ = modes.coefficients.leftCols(r);
      report_.latent_tail = modes.tail(static_cast<int>(r));
      say(fmt::format("latent: {} modes leave out {:.3g} %", r, 100 * report_.latent_tail));
    }
    modes_ = {3, modes.modes(), {}, modes.mean, modes.basis};
    modes_.points.resize(row / 3);
    std::iota(modes_.points.begin(), modes_.points.end(), 0);
    for (std::size_t i = 0; i < position.size(); ++i)
      position[i] -= snapshots_.set().reference()[i % row / 3][static_cast<int>(i % 3)];
    set_output(stage, std::move(position));
  }

  void set_output(Stage& stage, std::vector<float> values) {
    stage.output = standardization_of(values, static_cast<std::size_t>(stage.shape.outputs));
    standardize(values, stage.output);
    stage.module->set_targets(values, config_.memory_limit * 1e9);
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
  bool train(Stage& stage) {
    MlpBatches batches(options_.config.seed, stage_, snapshots_.set().snapshots(), points_, config_.batch_snapshots,
                       config_.batch_particles);
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

  void log(Stage& stage, int64_t steps, double progress) {
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
  void save(const Stage& stage) {
    Checkpoint checkpoint{state_, {}};
    checkpoint.state.seconds = seconds();
    for (const MlpArray array : all_mlp_arrays) checkpoint.arrays[name_of(array)] = stage.module->state(array);
    for (int s = 0; s < stage_; ++s) checkpoint.arrays[stage_kinds[s].name] = finished_[s];
    nn::Weights facts;
    facts.metadata = {{"stage", std::to_string(stage_)},
                      {"step", std::to_string(stage.step)},
                      {"seconds", fmt::format("{}", stage.seconds)}};
    checkpoint.arrays["stage"] = facts;
    write_checkpoint(checkpoint_folder(options_.run), checkpoint);
    prune_checkpoints(checkpoint_folder(options_.run), -1);
  }

  void finish(const Stage& stage) {
    const nn::Weights weights = stage.module->state(MlpArray::weights);
    finished_[stage_] = weights;
    networks_[stage_] = network_of(stage, weights);
    if (stage_ == 0 && conv()) {
      encoder_ = encoder_of(stage, weights, position_);
      const int64_t count = snapshots_.set().snapshots();
      latents_.resize(count, stage.shape.latents);
      for (int64_t i = 0; i < count; ++i) {
        const std::vector<double> q = stage.module->encode({i});
        for (std::size_t j = 0; j < q.size(); ++j) latents_(i, static_cast<Index>(j)) = q[j];
      }
    }
    const double error = error_of(stage);
    report_.stages.push_back(
        {kind().name, stage.shape.width, stage.step, stage.seconds, restored_stage_ > stage_ ? 0 : loss_, error});
    say(fmt::format("{}: {} steps in {}, error {:.3g} % of the deviation from the mean", kind().name, stage.step,
                    human_time(stage.seconds), 100 * error));
  }

  /// Over 64 snapshots spread over the training, all points.
  double error_of(const Stage& stage) const {
    const int64_t count = snapshots_.set().snapshots(), step = std::max<int64_t>(1, count / 64);
    MlpBatch batch;
    batch.points.resize(static_cast<std::size_t>(points_));
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

  /// Root of the mean square of every latent.
  std::vector<double> latent_scale() const {
    std::vector<double> scale;
    for (Index j = 0; j < latents_.cols(); ++j) {
      const Eigen::VectorXd q = latents_.col(j).array() - latents_.col(j).mean();
      scale.push_back(conv() ? std::max(std::sqrt(q.squaredNorm() / static_cast<double>(q.size())), 1e-6) : 1.0);
    }
    return scale;
  }

  const MlpTrainingOptions& options_;
  const MlpConfig& config_;
  MlpReport& report_;
  NsfSnapshots snapshots_;
  std::string config_text_;
  CheckpointState state_;  ///< `seconds` is that of the run's earlier parts
  std::map<std::string, nn::Weights> restored_;
  int restored_stage_ = -1;
  std::optional<MetricsLog> metrics_;
  Stopwatch watch_;
  int stage_ = 0;
  int64_t points_ = 0;  ///< of the stage
  int64_t logged_step_ = 0;
  double logged_seconds_ = 0, loss_ = 0;
  StopReason reason_ = StopReason::finished;
  MatrixXd latents_;      ///< of the training snapshots
  rom::ModeTable modes_;  ///< of the positions: samples are chosen by them
  rom::Standardization position_;
  nn::Weights finished_[stage_count];
  rom::Mlp networks_[stage_count];
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
