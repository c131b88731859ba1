#include "train/reduced/nsf_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "rom/fields/factored_fields.h"
#include "train/reduced/map_fit.h"
#include "train/reduced/network_fit.h"
#include "train/reduced/pod.h"
#include "train/reduced/sweep_snapshots.h"

namespace graupel::train {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// One training from the snapshots to the model; the fields' snapshots are in memory one after the other, or in blocks.
class FactoredTraining {
 public:
  FactoredTraining(const NsfTrainingOptions& options, NsfReport& report)
      : options_(options), config_(options.config), report_(report), snapshots_(options.data, config_, nsf_fields) {
    const SnapshotSet& set = snapshots_.set();
    report_.snapshots = set.snapshots();
    say(fmt::format("{} runs, {} snapshots of {} particles", set.runs(), set.snapshots(), set.particles()));
  }

  rom::ReducedModel run() {
    rom::ReducedModel model;
    snapshots_.choose_cluster_points(options_.message);
    fit_deformation();
    model.fields = std::make_shared<const rom::FactoredFields>(fit_fields());
    if (config_.stress == StressKind::law) model.gradient = rom::GradientKind::integrated;
    model.affine_kind = config_.affine;
    model.provenance = options_.provenance;
    model.singular_values = singular_values_;
    snapshots_.describe(latents_, std::vector<double>(static_cast<std::size_t>(latents_.cols()), 1.0), model);
    report_.read_seconds = snapshots_.read_seconds();
    calibrate_trust(model,
                    {snapshots_.set().file(), static_cast<int>(config_.calibration_runs),
                     [this](const std::string& text) { say(text); }},
                    report_.calibration);
    return model;
  }

 private:
  /// Beside the deformation, which is fitted.
  rom::FactoredFields fit_fields() {
    if (config_.stress == StressKind::law) return {std::move(deformation_), *closure_};
    rom::ModeTable stress, affine;
    auto stress_branch = fit_stress(stress);
    auto affine_branch = fit_affine(affine);
    return {std::move(deformation_),  *closure_,         std::move(stress),
            std::move(stress_branch), std::move(affine), std::move(affine_branch)};
  }

  void say(const std::string& text) const {
    if (options_.message) options_.message(text);
  }

  /// A field of the particles, or at the integration points: means over the clusters, cluster by cluster. What single
  /// particles have beside them is noise that no other run repeats.
  Pod decompose(SnapshotField field, const rom::Clusters* clusters, int64_t modes, PodMean about = PodMean::removed) {
    FieldBlocks blocks = snapshots_.blocks(field, clusters);
    if (blocks.blocks() > 1) say(fmt::format("{} blocks of snapshots, one after the other", blocks.blocks()));
    Pod pod = train::pod(blocks, static_cast<int>(modes), about);
    snapshots_.add_read_seconds(blocks.seconds());
    return pod;
  }

  rom::ModeTable table_of(const Pod& pod, SnapshotField field) const {
    rom::ModeTable table;
    table.components = components_of(field);
    table.modes = pod.modes();
    table.points.resize(pod.mean.size() / static_cast<std::size_t>(table.components));
    std::iota(table.points.begin(), table.points.end(), 0);
    table.mean = pod.mean;
    table.basis = pod.basis;
    return table;
  }

  /// A table of clusters as one of their representatives.
  rom::ModeTable at_representatives(const rom::ModeTable& by_cluster) const {
    rom::ModeTable table;
    table.components = by_cluster.components;
    table.modes = by_cluster.modes;
    const std::vector<int32_t>& representatives = snapshots_.representatives();
    std::vector<std::pair<int32_t, std::size_t>> order;
    for (std::size_t c = 0; c < representatives.size(); ++c) order.emplace_back(representatives[c], c);
    std::sort(order.begin(), order.end());
    const auto width = static_cast<std::size_t>(table.components), m = static_cast<std::size_t>(table.modes);
    for (const auto& [particle, c] : order) {
      table.points.push_back(particle);
      const auto append = [c = c](std::vector<float>& to, const std::vector<float>& from, std::size_t count) {
        const auto first = from.begin() + static_cast<std::ptrdiff_t>(c * count);
        to.insert(to.end(), first, first + static_cast<std::ptrdiff_t>(count));
      };
      append(table.mean, by_cluster.mean, width);
      append(table.basis, by_cluster.basis, width * m);
    }
    return table;
  }

  void tell(const char* name, const FieldReport& field) const {
    const std::string fit = config_.branch == rom::BranchKind::mlp
                                ? fmt::format("network, {:.1f} s", field.branch_seconds)
                                : fmt::format("ridge {:g}", field.ridge);
    say(fmt::format("{}: {} modes leave out {:.3g} %, branch {:.3g} % in held-out runs ({})", name, field.modes,
                    100 * field.tail, 100 * field.held_out_error, fit));
  }

  /// The map of a field's branch, from its inputs to the coefficients, or to those over `rates` where they are given.
  rom::SharedMap fit_branch(const char* name, const MatrixXd& inputs, const MatrixXd* rates, const MatrixXd& outputs,
                            FieldReport& field) {
    const Stopwatch watch;
    const std::vector<int>& run = snapshots_.run_of();
    if (config_.branch == rom::BranchKind::mlp) {
      const NetworkFitOptions options = network_options(name);
      NetworkFit fit =
          rates ? fit_rate_network(inputs, *rates, outputs, run, options) : fit_network(inputs, outputs, run, options);
      field.held_out_error = fit.held_out_error;
      field.branch_seconds = watch.seconds();
      return std::move(fit.map);
    }
    MapFit fit = rates ? fit_rate_map(inputs, *rates, outputs, run, static_cast<int>(config_.affine_centers))
                       : fit_map(inputs, outputs, run, static_cast<int>(config_.centers));
    field.held_out_error = fit.held_out_error;
    field.ridge = fit.ridge;
    field.branch_seconds = watch.seconds();
    return std::move(fit.map);
  }

  NetworkFitOptions network_options(const char* name) const {
    NetworkFitOptions options;
    options.width = static_cast<int>(config_.branch_width);
    options.steps = config_.branch_steps;
    options.batch = config_.branch_batch;
    options.learning_rate = config_.branch_learning_rate;
    options.noise = config_.branch_noise;
    options.seed = config_.seed;
    options.message = [this, name](const std::string& text) { say(std::string(name) + ": " + text); };
    return options;
  }

  /// Deformation, and with it the latents, and their velocities where they are asked for.
  void fit_deformation() {
    const Pod pod = decompose(SnapshotField::position, nullptr, config_.deformation_modes);
    keep_singular_values("deformation", pod);
    const auto r = static_cast<Index>(config_.latents);
    if (pod.modes() < r)
      throw ConfigError(fmt::format(
          "{} latents are more than the modes that the snapshots have ({}). Set latents lower, or train on more runs",
          r, pod.modes()));
    latents_ = pod.coefficients.leftCols(r);
    if (config_.affine == rom::AffineKind::rate) {
      FieldBlocks velocity = snapshots_.blocks(SnapshotField::velocity, nullptr);
      rates_ = project(velocity, pod, static_cast<int>(r));
      snapshots_.add_read_seconds(velocity.seconds());
    }
    FieldReport& field = report_.deformation;
    field.modes = pod.modes();
    field.tail = pod.tail(pod.modes());
    report_.latent_tail = pod.tail(static_cast<int>(r));
    say(fmt::format("latent: {} modes leave out {:.3g} %", r, 100 * report_.latent_tail));
    closure_.emplace(static_cast<int>(r),
                     fit_branch("deformation", latents_, nullptr, weighted(pod).rightCols(pod.modes() - r), field));
    deformation_ = unweighted_table(pod, SnapshotField::position, static_cast<int>(r));
    tell("deformation", field);
  }

  rom::MapBranch fit_stress(rom::ModeTable& table) {
    const Pod pod = decompose(SnapshotField::stress, &snapshots_.clusters(), config_.stress_modes);
    keep_singular_values("stress", pod);
    report_.stress.modes = pod.modes();
    report_.stress.tail = pod.tail(pod.modes());
    const rom::SharedMap map =
        fit_branch("stress", snapshots_.inputs(latents_), nullptr, weighted(pod), report_.stress);
    table = at_representatives(unweighted_table(pod, SnapshotField::stress));
    tell("stress", report_.stress);
    return rom::MapBranch(map);
  }

  std::shared_ptr<const rom::Branch> fit_affine(rom::ModeTable& table) {
    const Pod pod = decompose(SnapshotField::affine, &snapshots_.clusters(), config_.affine_modes, PodMean::kept);
    keep_singular_values("affine", pod);
    const bool rate = config_.affine == rom::AffineKind::rate;
    report_.affine.modes = pod.modes();
    report_.affine.tail = pod.tail(pod.modes());
    const rom::SharedMap map =
        fit_branch("affine", snapshots_.inputs(latents_), rate ? &rates_ : nullptr, weighted(pod), report_.affine);
    table = at_representatives(unweighted_table(pod, SnapshotField::affine));
    tell("affine", report_.affine);
    if (rate) return std::make_shared<const rom::RateBranch>(static_cast<int>(config_.latents), map);
    return std::make_shared<const rom::MapBranch>(map);
  }

  void keep_singular_values(const std::string& field, const Pod& pod) {
    singular_values_[field].assign(pod.singular.data(), pod.singular.data() + pod.singular.size());
  }

  /// Coefficients that count as much as their modes do.
  static MatrixXd weighted(const Pod& pod) {
    const double size = pod.singular[0];
    return pod.coefficients.array().rowwise() * (pod.singular.head(pod.modes()).transpose().array() / size);
  }
  /// The table for such coefficients from mode `first` on.
  rom::ModeTable unweighted_table(const Pod& pod, SnapshotField field, int first = 0) const {
    rom::ModeTable table = table_of(pod, field);
    for (std::size_t i = 0; i < table.basis.size(); ++i) {
      const auto mode = static_cast<Index>(i % static_cast<std::size_t>(table.modes));
      if (mode >= first) table.basis[i] *= static_cast<float>(pod.singular[0] / pod.singular[mode]);
    }
    return table;
  }

  const NsfTrainingOptions& options_;
  const NsfConfig& config_;
  NsfReport& report_;
  SweepSnapshots snapshots_;
  MatrixXd latents_;
  MatrixXd rates_;  ///< where the affine field follows the velocity
  rom::ModeTable deformation_;
  std::optional<rom::ClosureBranch> closure_;
  std::map<std::string, std::vector<float>> singular_values_;
};

}  // namespace

rom::ReducedModel train_factored(const NsfTrainingOptions& options, NsfReport& report) {
  const Stopwatch watch;
  rom::ReducedModel model = FactoredTraining(options, report).run();
  report.seconds = watch.seconds();
  return model;
}

}  // namespace graupel::train
