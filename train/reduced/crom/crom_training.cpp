#include "train/reduced/crom/crom_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "core/system/error.h"
#include "core/system/human_time.h"
#include "io/config/config_description.h"
#include "rom/deformation/mlp_deformation.h"
#include "rom/fields/deformation_fields.h"
#include "train/parallel/blas_threads.h"
#include "train/reduced/crom/crom_sweep.h"

namespace graupel::train {

using Eigen::MatrixXd;

namespace {

/// Of about 64 snapshots, spread over the file.
ReconstructionErrors judge(const rom::Deformation& map, const SnapshotSet& set, const MatrixXd& latents) {
  constexpr int64_t judged = 64;
  return reconstruction_errors(map, set, latents, std::max<int64_t>(1, set.snapshots() / judged));
}

StagePlan plan_of(const CromTrainingOptions& options, const MlpBatches& batches) {
  const CromConfig& config = options.config;
  const auto epochs = static_cast<double>(CromConfig::all_epochs());
  StagePlan plan;
  plan.steps = std::max<int64_t>(1, std::llround(epochs * config.epochs_scale * batches.steps_per_epoch()));
  plan.seconds = options.time_limit;
  plan.rate_at = [&config](double share) { return config.rate_at(share); };
  plan.log_interval = config.log_interval;
  plan.checkpoint_interval = config.checkpoint_interval;
  plan.rate_key = "learning_rate";
  return plan;
}

std::string text_of(const ReconstructionErrors& e) {
  return fmt::format("positions {:.3g} % (of the displacement {:.3g} %), F {:.3g} % of F - I, velocities {:.3g} %",
                     100 * e.position, 100 * e.displacement, 100 * e.gradient, 100 * e.velocity);
}

/// Errors in the runs for testing; nothing without such.
std::optional<ReconstructionErrors> test_errors(const rom::Deformation& map, const CromSweep& sweep,
                                                const std::string& data) {
  const std::string file = data + "/test.h5";
  if (!std::filesystem::exists(file)) return std::nullopt;
  const SnapshotSet set(file, {ParticleField::deformation_gradient});
  if (!(set.reference() == sweep.snapshots().set().reference()))
    throw InputError("'" + file + "' starts with other particles than '" + sweep.snapshots().set().file() +
                     "'. Make the data set again, or remove the file");
  return judge(map, set, sweep.latents_of(set));
}

std::shared_ptr<const rom::Deformation> modes_of(const CromSweep& sweep, const std::vector<double>& rest) {
  return std::make_shared<const rom::ModeDeformation>(sweep.modes(rest));
}

/// Trained; nothing when it was stopped.
std::shared_ptr<const rom::Deformation> network_of(CromSweep& sweep, const std::vector<double>& rest,
                                                   const CromTrainingOptions& options, StageRun& run,
                                                   CromReport& report) {
  const CromConfig& config = options.config;
  const SnapshotSet& set = sweep.snapshots().set();
  MlpModule module = sweep.module(options.device);
  MlpBatches batches(config.seed, 0, set.snapshots(), set.particles(), config.batch_snapshots, config.batch_particles);
  const StagePlan plan = plan_of(options, batches);
  run.say(fmt::format("{} steps", plan.steps));
  const auto progress = run.train(0, module, batches, plan);
  if (!progress) return nullptr;
  report.steps = progress->step;
  report.loss = progress->loss;
  return std::make_shared<const rom::MlpDeformation>(sweep.network(module.state(MlpArray::weights)), rest);
}

}  // namespace

std::optional<rom::ReducedModel> train_crom(const CromTrainingOptions& options, CromReport& report) {
  const Stopwatch watch;
  const CromConfig& config = options.config;
  configure_torch(options.threads, config.tf32);
  const BlasThreads one_thread(1);  // products of width 30 are too small to share
  CromSweep sweep(options.data, config);
  StageRun run(options, io::write_json(io::json_of_struct(config), io::JsonLayout::compact), config.seed,
               {"deformation"}, sweep.snapshots().set().hash());
  const SnapshotSet& set = sweep.snapshots().set();
  report.snapshots = set.snapshots();
  report.latent_tail = sweep.latent_tail();
  run.say(fmt::format("{} runs, {} snapshots of {} particles; {} latents leave out {:.3g} %", set.runs(),
                      set.snapshots(), set.particles(), config.latents, 100 * report.latent_tail));
  rom::ReducedModel model;
  model.kind = rom::ReducedKind::crom;
  model.affine_kind = rom::AffineKind::position;
  model.projection = config.projection;
  // Integrated gradients have the load of a contact in themselves.
  model.contact_weight = config.gradient == rom::GradientKind::map ? config.contact_weight : 1;
  model.quadrature = config.quadrature;
  model.gradient = config.gradient;
  model.provenance = options.provenance;
  sweep.describe(model);
  const auto map = config.map == rom::DeformationKind::modes
                       ? modes_of(sweep, model.start_latent)
                       : network_of(sweep, model.start_latent, options, run, report);
  report.reason = run.reason();
  report.seconds = watch.seconds();
  if (!map) return std::nullopt;
  const auto fields = std::make_shared<const rom::DeformationFields>(model.reference, map);
  model.fields = fields;
  report.training = judge(fields->deformation(), set, sweep.latents());
  run.say("training runs: " + text_of(report.training));
  report.test = test_errors(fields->deformation(), sweep, options.data);
  if (report.test) run.say("test runs: " + text_of(*report.test));
  calibrate_trust(model, {set.file(), static_cast<int>(config.calibration_runs), options.message}, report.calibration);
  report.read_seconds = sweep.snapshots().read_seconds();
  report.run_seconds = run.seconds();
  report.seconds = watch.seconds();
  return model;
}

}  // namespace graupel::train
