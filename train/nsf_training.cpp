#include "train/nsf_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/error.h"
#include "core/parallel_for.h"
#include "core/random.h"
#include "train/map_fit.h"
#include "train/pod.h"
#include "train/trust_calibration.h"

namespace graupel::train {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/// One training from the snapshots to the model; the fields' arrays are in memory one after the other.
class FactoredTraining {
 public:
  FactoredTraining(const NsfTrainingOptions& options, NsfReport& report)
      : options_(options), config_(options.config), report_(report), set_(options.data + "/train.h5") {
    for (int run = 0; run < set_.runs(); ++run)
      run_of_.insert(run_of_.end(), static_cast<std::size_t>(set_.first_snapshot(run + 1) - set_.first_snapshot(run)),
                     run);
    report_.snapshots = set_.snapshots();
    clusters_ = rom::make_clusters(set_.reference(), set_.particle_kind(), static_cast<int>(config_.cluster));
    representatives_ = clusters_.representatives();
    say(fmt::format("{} runs, {} snapshots of {} particles", set_.runs(), set_.snapshots(), set_.particles()));
  }

  rom::ReducedModel run() {
    rom::ReducedModel model;
    fit_deformation();
    rom::ModeTable stress, affine;
    auto stress_branch = fit_stress(stress);
    auto affine_branch = fit_affine(affine);
    model.clusters = clusters_;
    model.fields = std::make_shared<const rom::FactoredFields>(std::move(deformation_), *closure_, std::move(stress),
                                                               std::move(stress_branch), std::move(affine),
                                                               std::move(affine_branch));
    describe(model);
    choose_particles(model);
    calibrate_trust(model, {set_.file(), static_cast<int>(config_.calibration_runs)}, report_.calibration);
    if (config_.calibration_runs > 0)
      say(fmt::format("trust: {} training runs rolled out in {:.1f} s, error up to {:.3g} % of the displacement",
                      report_.calibration.runs, report_.calibration.seconds, 100 * model.usual_error));
    return model;
  }

 private:
  void say(const std::string& text) const {
    if (options_.message) options_.message(text);
  }

  std::vector<float> read(SnapshotField field) {
    const Stopwatch watch;
    std::vector<float> values = set_.read(field, 0, set_.particles());
    report_.read_seconds += watch.seconds();
    return values;
  }
  /// A field at the integration points: means over the clusters, cluster by cluster. What single particles have beside
  /// them is noise that no other run repeats.
  std::vector<float> read_means(SnapshotField field) {
    const std::vector<float> values = read(field);
    const auto width = static_cast<std::size_t>(components_of(field)), n = clusters_.of_particle.size();
    const std::size_t row = representatives_.size() * width;
    std::vector<float> means(static_cast<std::size_t>(set_.snapshots()) * row, 0.0f),
        members(representatives_.size(), 0.0f);
    for (const int32_t c : clusters_.of_particle) members[static_cast<std::size_t>(c)] += 1;
    const auto average = [&](int64_t snapshot) {
      const auto i = static_cast<std::size_t>(snapshot);
      for (std::size_t p = 0; p < n; ++p) {
        const auto c = static_cast<std::size_t>(clusters_.of_particle[p]);
        for (std::size_t k = 0; k < width; ++k)
          means[i * row + c * width + k] += values[(i * n + p) * width + k] / members[c];
      }
    };
    parallel_for(Device::cpu, set_.snapshots(), average, Grain{1});
    return means;
  }
  SnapshotMatrix matrix(const std::vector<float>& values) const {
    const auto rows = static_cast<Index>(set_.snapshots());
    return {values.data(), rows, static_cast<Index>(values.size()) / rows};
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
    std::vector<std::pair<int32_t, std::size_t>> order;
    for (std::size_t c = 0; c < representatives_.size(); ++c) order.emplace_back(representatives_[c], c);
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

  /// (q, mu) of every snapshot.
  MatrixXd inputs() const {
    const auto& parameters = set_.parameters();
    MatrixXd z(latents_.rows(), latents_.cols() + static_cast<Index>(parameters.size()));
    z.leftCols(latents_.cols()) = latents_;
    for (std::size_t p = 0; p < parameters.size(); ++p)
      for (Index i = 0; i < z.rows(); ++i)
        z(i, latents_.cols() + static_cast<Index>(p)) =
            parameters[p].values[static_cast<std::size_t>(run_of_[static_cast<std::size_t>(i)])];
    return z;
  }

  void tell(const char* name, const FieldReport& field) const {
    say(fmt::format("{}: {} modes leave out {:.3g} %, branch {:.3g} % in held-out runs (ridge {:g})", name, field.modes,
                    100 * field.tail, 100 * field.held_out_error, field.ridge));
  }

  /// Deformation, and with it the latents and their velocities.
  void fit_deformation() {
    Pod pod;
    {
      const std::vector<float> position = read(SnapshotField::position);
      pod = train::pod(matrix(position), static_cast<int>(config_.deformation_modes));
    }
    keep_singular_values("deformation", pod);
    const auto r = static_cast<Index>(config_.latents);
    if (pod.modes() < r)
      throw ConfigError(fmt::format(
          "{} latents are more than the modes that the snapshots have ({}). Set latents lower, or train on more runs",
          r, pod.modes()));
    latents_ = pod.coefficients.leftCols(r);
    const std::vector<float> velocity = read(SnapshotField::velocity);
    rates_ = project(matrix(velocity), pod, static_cast<int>(r));
    FieldReport& field = report_.deformation;
    field.modes = pod.modes();
    field.tail = pod.tail(pod.modes());
    report_.latent_tail = pod.tail(static_cast<int>(r));
    const MapFit fit = fit_map(latents_, weighted(pod).rightCols(pod.modes() - r), run_of_, centers());
    field.held_out_error = fit.held_out_error;
    field.ridge = fit.ridge;
    closure_.emplace(static_cast<int>(r), fit.map);
    deformation_ = unweighted_table(pod, SnapshotField::position, static_cast<int>(r));
    say(fmt::format("latent: {} modes leave out {:.3g} %", r, 100 * report_.latent_tail));
    tell("deformation", field);
  }

  rom::MapBranch fit_stress(rom::ModeTable& table) {
    const std::vector<float> stress = read_means(SnapshotField::stress);
    const Pod pod = train::pod(matrix(stress), static_cast<int>(config_.stress_modes));
    keep_singular_values("stress", pod);
    const MapFit fit = fit_map(inputs(), weighted(pod), run_of_, centers());
    report_.stress = {pod.modes(), pod.tail(pod.modes()), fit.held_out_error, fit.ridge};
    table = at_representatives(unweighted_table(pod, SnapshotField::stress));
    tell("stress", report_.stress);
    return rom::MapBranch(fit.map);
  }

  std::shared_ptr<const rom::Branch> fit_affine(rom::ModeTable& table) {
    const std::vector<float> affine = read_means(SnapshotField::affine);
    const Pod pod = train::pod(matrix(affine), static_cast<int>(config_.affine_modes), PodMean::kept);
    keep_singular_values("affine", pod);
    const bool rate = config_.affine == rom::AffineKind::rate;
    const MapFit fit =
        rate ? fit_rate_map(inputs(), rates_, weighted(pod), run_of_, static_cast<int>(config_.affine_centers))
             : fit_map(inputs(), weighted(pod), run_of_, centers());
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

  void describe(rom::ReducedModel& model) const {
    model.affine_kind = config_.affine;
    model.scene_json = set_.scene_json();
    model.frame_time = set_.frame_time();
    model.substeps_per_frame = set_.substeps_per_frame();
    model.provenance = options_.provenance;
    model.singular_values = singular_values_;
    for (const SweptParameter& p : set_.parameters()) {
      const auto [low, high] = std::minmax_element(p.values.begin(), p.values.end());
      model.parameters.push_back({p.name, p.unit, p.keys, *low, *high});
    }
    for (const Vec3f& x : set_.reference())
      for (int d = 0; d < 3; ++d) model.reference.push_back(x[d]);
    const auto r = static_cast<std::size_t>(config_.latents);
    model.start_latent.assign(r, 0);
    for (int run = 0; run < set_.runs(); ++run)
      for (std::size_t j = 0; j < r; ++j)
        model.start_latent[j] += latents_(static_cast<Index>(set_.first_snapshot(run)), static_cast<Index>(j)) /
                                 static_cast<double>(set_.runs());
    model.latent_scale.assign(r, 1.0f);
    for (Index i = 0; i < latents_.rows(); ++i)
      for (std::size_t j = 0; j < r; ++j)
        model.training_latents.push_back(static_cast<float>(latents_(i, static_cast<Index>(j))));
    model.latent_reach = reach();
  }

  /// Largest distance of a snapshot to the nearest one of another run.
  double reach() const {
    double furthest = 0;
    for (Index i = 0; i < latents_.rows(); ++i) {
      double least = std::numeric_limits<double>::infinity();
      for (Index j = 0; j < latents_.rows(); ++j)
        if (run_of_[static_cast<std::size_t>(i)] != run_of_[static_cast<std::size_t>(j)])
          least = std::min(least, (latents_.row(i) - latents_.row(j)).norm());
      if (std::isfinite(least)) furthest = std::max(furthest, least);
    }
    return furthest > 0 ? furthest : 1;
  }

  void choose_particles(rom::ReducedModel& model) const {
    const auto n = static_cast<int32_t>(set_.particles());
    std::vector<int32_t> order(static_cast<std::size_t>(n));
    std::iota(order.begin(), order.end(), 0);
    const Random random(config_.seed, RandomPurpose::sample_particle);
    for (int32_t i = n - 1; i > 0; --i)
      std::swap(order[static_cast<std::size_t>(i)],
                order[random.integer(static_cast<uint64_t>(i), 0, static_cast<uint32_t>(i + 1))]);
    const auto first = [&](int64_t count) {
      std::vector<int32_t> chosen(order.begin(), order.begin() + std::min<int64_t>(count, n));
      std::sort(chosen.begin(), chosen.end());
      return chosen;
    };
    const auto candidates =
        rom::points_within(representatives_, model.reference, config_.sample_low, config_.sample_high);
    if (candidates.empty())
      throw ConfigError(
          "no integration point lies in the samples' box (sample_low, sample_high). Widen it; 'graupel inspect' of the "
          "data set shows where the body is");
    model.samples = rom::choose_samples(config_.sample_rule, model.fields->deformation(), candidates, config_.samples,
                                        config_.seed);
    model.outlier_factor = config_.outlier_factor;
    model.encoder = first(config_.encoder_particles);
  }

  const NsfTrainingOptions& options_;
  const NsfConfig& config_;
  NsfReport& report_;
  SnapshotSet set_;
  std::vector<int> run_of_;  ///< [snapshots]
  rom::Clusters clusters_;
  std::vector<int32_t> representatives_;  ///< of the clusters
  MatrixXd latents_, rates_;
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
