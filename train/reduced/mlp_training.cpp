#include "train/reduced/mlp_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/system/human_time.h"
#include "core/system/stopwatch.h"
#include "io/config/config_description.h"
#include "rom/fields/mlp_fields.h"
#include "train/reduced/mlp/mlp_batches.h"
#include "train/reduced/mlp_sweep.h"

namespace graupel::train {

namespace {

std::vector<std::string> stage_names() {
  std::vector<std::string> names;
  for (const MlpStageKind& kind : mlp_stage_kinds) names.emplace_back(kind.name);
  return names;
}

class MlpTraining {
 public:
  MlpTraining(const MlpTrainingOptions& options, MlpReport& report)
      : options_(options),
        config_(options.config.mlp),
        report_(report),
        sweep_(options.data, options.config, options.message),
        run_(options, io::write_json(io::json_of_struct(options.config), io::JsonLayout::compact), options.config.seed,
             stage_names(), sweep_.snapshots().set().hash()) {
    const SnapshotSet& set = sweep_.snapshots().set();
    report_.snapshots = set.snapshots();
    run_.say(fmt::format("{} runs, {} snapshots of {} particles", set.runs(), set.snapshots(), set.particles()));
  }

  std::optional<rom::ReducedModel> run() {
    report_.stages.clear();
    sweep_.snapshots().choose_cluster_points(options_.message);
    for (stage_ = 0; stage_ < mlp_stage_count; ++stage_) {
      MlpStage stage = sweep_.prepare(stage_, options_.device);
      report_.latent_tail = sweep_.latent_tail();
      MlpBatches batches(options_.config.seed, stage_, sweep_.snapshots().set().snapshots(), stage.points,
                         config_.batch_snapshots, config_.batch_particles);
      const StagePlan plan = plan_of(batches);
      run_.say(fmt::format("{}: width {}, {} steps", kind().name, stage.shape.width, plan.steps));
      const auto progress = run_.train(stage_, *stage.module, batches, plan);
      report_.reason = run_.reason();
      if (!progress) return std::nullopt;
      finish(stage, *progress);
    }
    rom::ReducedModel model;
    model.fields = std::make_shared<const rom::MlpFields>(static_cast<int>(options_.config.latents), sweep_.reference(),
                                                          networks_[0], networks_[1], networks_[2]);
    model.conv_encoder = encoder_;
    model.affine_kind = rom::AffineKind::position;
    model.provenance = options_.provenance;
    sweep_.describe(model);
    report_.read_seconds = sweep_.snapshots().read_seconds();
    report_.run_seconds = run_.seconds();
    return model;
  }

 private:
  const MlpStageKind& kind() const { return mlp_stage_kinds[stage_]; }

  StagePlan plan_of(const MlpBatches& batches) const {
    const auto g = static_cast<double>(config_.deformation_epochs), other = static_cast<double>(config_.field_epochs),
               epochs = stage_ == 0 ? g : other;
    StagePlan plan;
    plan.steps = std::max<int64_t>(1, std::llround(5 * epochs * config_.epochs_scale * batches.steps_per_epoch()));
    plan.seconds = options_.time_limit * epochs / (g + 2 * other);
    plan.rate_at = [this](double share) { return config_.rate_at(share); };
    plan.log_interval = config_.log_interval;
    plan.checkpoint_interval = config_.checkpoint_interval;
    plan.rate_key = "mlp.learning_rate";
    return plan;
  }

  void finish(const MlpStage& stage, const StageProgress& progress) {
    const nn::Weights weights = stage.module->state(MlpArray::weights);
    networks_[stage_] = stage.network(weights);
    if (stage_ == 0) encoder_ = sweep_.take_encoder(stage, weights);
    const double error = error_of(stage);
    report_.stages.push_back({kind().name, stage.shape.width, progress.step, progress.seconds, progress.loss, error});
    run_.say(fmt::format("{}: {} steps in {}, error {:.3g} % of the deviation from the mean", kind().name,
                         progress.step, human_time(progress.seconds), 100 * error));
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
  StageRun run_;
  int stage_ = 0;
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
