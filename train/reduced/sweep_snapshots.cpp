#include "train/reduced/sweep_snapshots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/math/random.h"
#include "core/parallel/memory.h"
#include "core/system/error.h"
#include "train/reduced/cluster_points.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::MatrixXd;

SweepSnapshots::SweepSnapshots(const std::string& data, const NsfConfig& config, const FieldSet& fields)
    : config_(config), set_(data + "/train.h5", fields) {
  for (int run = 0; run < set_.runs(); ++run)
    run_of_.insert(run_of_.end(), static_cast<std::size_t>(set_.first_snapshot(run + 1) - set_.first_snapshot(run)),
                   run);
  clusters_ = rom::make_clusters(set_.reference(), set_.particle_kind(), static_cast<int>(config_.cluster));
  representatives_ = clusters_.representatives();
}

FieldBlocks SweepSnapshots::blocks(SnapshotField field, const rom::Clusters* clusters) const {
  const double bytes =
      config_.memory > 0 ? 1e9 * config_.memory : 0.5 * static_cast<double>(available_bytes(Device::cpu));
  return {set_, field, clusters, bytes};
}

std::vector<float> SweepSnapshots::whole(SnapshotField field, const rom::Clusters* clusters) {
  FieldBlocks blocks(set_, field, clusters, std::numeric_limits<double>::infinity());
  const SnapshotMatrix all = blocks.load(0);
  read_seconds_ += blocks.seconds();
  return {all.data(), all.data() + all.size()};
}

std::vector<float> SweepSnapshots::read(SnapshotField field) { return whole(field, nullptr); }

std::vector<float> SweepSnapshots::read_means(SnapshotField field) { return whole(field, &clusters_); }

void SweepSnapshots::choose_cluster_points(const std::function<void(const std::string&)>& message) {
  if (config_.cluster == 1 || config_.cluster_point == ClusterPoint::random) return;
  ClusterPoints chosen = match_cluster_points(set_, clusters_, config_.quadrature_snapshots);
  clusters_.points = representatives_ = std::move(chosen.points);
  read_seconds_ += chosen.read_seconds;
  if (message)
    message(
        fmt::format("cluster points: nodes' masses off by {:.3g} instead of {:.3g} %, forces by {:.3g} instead of "
                    "{:.3g} % ({:.1f} s)",
                    100 * chosen.after.mass, 100 * chosen.before.mass, 100 * chosen.after.force,
                    100 * chosen.before.force, chosen.seconds));
}

SnapshotMatrix SweepSnapshots::matrix(const std::vector<float>& values) const {
  const auto rows = static_cast<Index>(set_.snapshots());
  return {values.data(), rows, static_cast<Index>(values.size()) / rows};
}

MatrixXd SweepSnapshots::inputs(const MatrixXd& latents) const {
  const auto& parameters = set_.parameters();
  MatrixXd z(latents.rows(), latents.cols() + static_cast<Index>(parameters.size()));
  z.leftCols(latents.cols()) = latents;
  for (std::size_t p = 0; p < parameters.size(); ++p)
    for (Index i = 0; i < z.rows(); ++i)
      z(i, latents.cols() + static_cast<Index>(p)) =
          parameters[p].values[static_cast<std::size_t>(run_of_[static_cast<std::size_t>(i)])];
  return z;
}

void SweepSnapshots::describe(const MatrixXd& latents, const std::vector<double>& scale,
                              rom::ReducedModel& model) const {
  model.clusters = clusters_;
  model.scene_json = set_.scene_json();
  model.frame_time = set_.frame_time();
  model.substeps_per_frame = set_.substeps_per_frame();
  for (const SweptParameter& p : set_.parameters()) {
    const auto [low, high] = std::minmax_element(p.values.begin(), p.values.end());
    model.parameters.push_back({p.name, p.unit, p.keys, *low, *high});
  }
  for (const Vec3f& x : set_.reference())
    for (int d = 0; d < 3; ++d) model.reference.push_back(x[d]);
  const auto r = static_cast<std::size_t>(latents.cols());
  model.start_latent.assign(r, 0);
  for (int run = 0; run < set_.runs(); ++run)
    for (std::size_t j = 0; j < r; ++j)
      model.start_latent[j] += latents(static_cast<Index>(set_.first_snapshot(run)), static_cast<Index>(j)) /
                               static_cast<double>(set_.runs());
  model.latent_scale.assign(scale.begin(), scale.end());
  for (Index i = 0; i < latents.rows(); ++i)
    for (std::size_t j = 0; j < r; ++j)
      model.training_latents.push_back(static_cast<float>(latents(i, static_cast<Index>(j))));
  MatrixXd scaled = latents;
  for (std::size_t j = 0; j < r; ++j) scaled.col(static_cast<Index>(j)) /= scale[j];
  model.latent_reach = reach(scaled);
  choose_particles(model);
}

/// Largest distance of a snapshot to the nearest one of another run.
double SweepSnapshots::reach(const MatrixXd& latents) const {
  double furthest = 0;
  for (Index i = 0; i < latents.rows(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (Index j = 0; j < latents.rows(); ++j)
      if (run_of_[static_cast<std::size_t>(i)] != run_of_[static_cast<std::size_t>(j)])
        least = std::min(least, (latents.row(i) - latents.row(j)).norm());
    if (std::isfinite(least)) furthest = std::max(furthest, least);
  }
  return furthest > 0 ? furthest : 1;
}

void SweepSnapshots::choose_particles(rom::ReducedModel& model) const {
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
  model.samples = rom::choose_samples(config_.sample_rule, candidates, config_.samples, config_.seed);
  model.step_factor = config_.step_factor;
  model.manifold_pull = config_.manifold_pull;
  model.training_run.assign(run_of_.begin(), run_of_.end());
  for (int run = 0; run < set_.runs(); ++run)
    for (const SweptParameter& p : set_.parameters())
      model.run_parameters.push_back(static_cast<float>(p.values[static_cast<std::size_t>(run)]));
  model.encoder = first(config_.encoder_particles);
}

}  // namespace graupel::train
