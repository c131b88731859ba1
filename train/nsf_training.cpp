#include "train/nsf_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "core/error.h"
#include "rom/factored_fields.h"
#include "train/map_fit.h"
#include "train/nsf_snapshots.h"
#include "train/pod.h"
#include "train/stopwatch.h"
#include "train/trust_calibration.h"

namespace graupel::train {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// One training from the snapshots to the model; the fields' snapshots are in memory one after the other, or in blocks.
class FactoredTraining {
 public:
  FactoredTraining(const NsfTrainingOptions& options, NsfReport& report)
      : options_(options), config_(options.config), report_(report), snapshots_(options.data, config_) {
    const SnapshotSet& set = snapshots_.set();
    report_.snapshots = set.snapshots();
    say(fmt::format("{} runs, {} snapshots of {} particles", set.runs(), set.snapshots(), set.particles()));
  }

  rom::ReducedModel run() {
    rom::ReducedModel model;
    snapshots_.fit_quadrature(options_.message);
    fit_deformation();
    rom::ModeTable stress, affine;
    auto stress_branch = fit_stress(stress);
    auto affine_branch = fit_affine(affine);
    model.fields = std::make_shared<const rom::FactoredFields>(std::move(deformation_), *closure_, std::move(stress),
                                                               std::move(stress_branch), std::move(affine),
                                                               std::move(affine_branch));
    model.affine_kind = config_.affine;
    model.provenance = options_.provenance;
    model.singular_values = singular_values_;
    const auto& fields = dynamic_cast<const rom::FactoredFields&>(*model.fields);
    snapshots_.describe(latents_, std::vector<double>(static_cast<std::size_t>(latents_.cols()), 1.0),
                        fields.deformation(), model);
    report_.read_seconds = snapshots_.read_seconds();
    calibrate(model);
    return model;
  }

 private:
  /// Data of another machine may lack the meshes that its scenes name; the fields do not need them.
  void calibrate(rom::ReducedModel& model) {
    if (config_.calibration_runs == 0) return;
    CalibrationReport& report = report_.calibration;
    try {
      calibrate_trust(model, {snapshots_.set().file(), static_cast<int>(config_.calibration_runs)}, report);
    } catch (const InputError& error) {
      say(fmt::format("no verdict on trust: the training runs cannot be rolled out ({})", error.what()));
      return;
    }
    say(fmt::format("trust: {} training runs rolled out in {:.1f} s, error up to {:.3g} % of the displacement",
                    report.runs, report.seconds, 100 * model.usual_error));
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
    say(fmt::format("{}: {} modes leave out {:.3g} %, branch {:.3g} % in held-out runs (ridge {:g})", name, field.modes,
                    100 * field.tail, 100 * field.held_out_error, field.ridge));
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
    const MapFit fit = fit_map(latents_, weighted(pod).rightCols(pod.modes() - r), snapshots_.run_of(), centers());
    field.held_out_error = fit.held_out_error;
    field.ridge = fit.ridge;
    closure_.emplace(static_cast<int>(r), fit.map);
    deformation_ = unweighted_table(pod, SnapshotField::position, static_cast<int>(r));
    say(fmt::format("latent: {} modes leave out {:.3g} %", r, 100 * report_.latent_tail));
    tell("deformation", field);
  }

  rom::MapBranch fit_stress(rom::ModeTable& table) {
    const Pod pod = decompose(SnapshotField::stress, &snapshots_.clusters(), config_.stress_modes);
    keep_singular_values("stress", pod);
    const MapFit fit = fit_map(snapshots_.inputs(latents_), weighted(pod), snapshots_.run_of(), centers());
    report_.stress = {pod.modes(), pod.tail(pod.modes()), fit.held_out_error, fit.ridge};
    table = at_representatives(unweighted_table(pod, SnapshotField::stress));
    tell("stress", report_.stress);
    return rom::MapBranch(fit.map);
  }

  std::shared_ptr<const rom::Branch> fit_affine(rom::ModeTable& table) {
    const Pod pod = decompose(SnapshotField::affine, &snapshots_.clusters(), config_.affine_modes, PodMean::kept);
    keep_singular_values("affine", pod);
    const bool rate = config_.affine == rom::AffineKind::rate;
    const MapFit fit = rate ? fit_rate_map(snapshots_.inputs(latents_), rates_, weighted(pod), snapshots_.run_of(),
                                           static_cast<int>(config_.affine_centers))
                            : fit_map(snapshots_.inputs(latents_), weighted(pod), snapshots_.run_of(), centers());
    report_.affine = {pod.modes(), pod.tail(pod.modes()), fit.held_out_error, fit.ridge};
    table = at_representatives(unweighted_table(pod, SnapshotField::affine));
    tell("affine", report_.affine);
    if (rate) return std::make_shared<const rom::RateBranch>(static_cast<int>(config_.latents), fit.map);
    return std::make_shared<const rom::MapBranch>(fit.map);
  }

  void keep_singular_values(const std::string& field, const Pod& pod) {
    singular_values_[field].assign(pod.singular.data(), pod.singular.data() + pod.singular.size());
  }

  int centers() const { return static_cast<int>(config_.centers); }

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
  NsfSnapshots snapshots_;
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
