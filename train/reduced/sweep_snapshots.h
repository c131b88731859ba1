// What every training of a reduced-order model takes from its sweep: the fields of all snapshots, means over clusters,
// and the parts of the model that do not depend on how its fields are represented.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "rom/fields/mode_table.h"
#include "rom/reduced_model.h"
#include "train/config/nsf_config.h"
#include "train/reduced/pod.h"
#include "train/reduced/snapshot_blocks.h"
#include "train/reduced/snapshot_set.h"

namespace graupel::train {

/// What the trainings of Neural Stress Fields need.
inline const FieldSet nsf_fields = {ParticleField::stress, ParticleField::affine};

class SweepSnapshots {
 public:
  /// `data`: folder of the data set; its train.h5 is read, for a training that needs `fields`. `config` must outlive
  /// this. Throws InputError as SnapshotSet.
  SweepSnapshots(const std::string& data, const NsfConfig& config, const FieldSet& fields);

  const SnapshotSet& set() const { return set_; }
  const std::vector<int>& run_of() const { return run_of_; }  ///< [snapshots]
  const rom::Clusters& clusters() const { return clusters_; }
  const std::vector<int32_t>& representatives() const { return representatives_; }  ///< of the clusters
  double read_seconds() const { return read_seconds_; }

  /// A field of the particles or, with clusters, its means over these, within the configured memory.
  FieldBlocks blocks(SnapshotField field, const rom::Clusters* clusters) const;
  /// Chooses the clusters' points, as configured; before anything else that needs the clusters.
  void choose_cluster_points(const std::function<void(const std::string&)>& message);
  void add_read_seconds(double seconds) { read_seconds_ += seconds; }
  /// A field of all particles, [snapshots, particles * components].
  std::vector<float> read(SnapshotField field);
  /// A field at the integration points: means over the clusters, cluster by cluster. What single particles have beside
  /// them is noise that no other run repeats.
  std::vector<float> read_means(SnapshotField field);
  SnapshotMatrix matrix(const std::vector<float>& values) const;
  /// (q, mu) of every snapshot, from its latents [snapshots, r].
  Eigen::MatrixXd inputs(const Eigen::MatrixXd& latents) const;

  /// Fills in the scene, parameters, clusters, particles and latents of the training; `scale`: of each latent [r].
  /// Throws ConfigError when no sample is within the configured box.
  void describe(const Eigen::MatrixXd& latents, const std::vector<double>& scale, rom::ReducedModel& model) const;

 private:
  double reach(const Eigen::MatrixXd& latents) const;
  std::vector<float> whole(SnapshotField field, const rom::Clusters* clusters);
  void choose_particles(rom::ReducedModel& model) const;

  const NsfConfig& config_;
  SnapshotSet set_;
  std::vector<int> run_of_;
  rom::Clusters clusters_;
  std::vector<int32_t> representatives_;
  double read_seconds_ = 0;
};

}  // namespace graupel::train
