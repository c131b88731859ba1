// Settings of the training of a reduced-order model with stress field (NSF).
#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/fields.h"
#include "core/scene/removed_field.h"
#include "rom/cubature/sample_selection.h"
#include "rom/fields/branch_map.h"
#include "rom/reduced_model.h"
#include "train/config/mlp_config.h"

namespace graupel::train {

/// How the modes are stored in the weights file.
enum class ModeStorage { f32, f16 };

/// Which of its particles a cluster's integration point is.
enum class ClusterPoint {
  random,
  matched  ///< the one with which sums at grid nodes are most like those of all particles
           ///< (train/reduced/cubature_rows.h)
};

constexpr auto enum_list(ModeStorage) {
  return std::to_array<std::pair<const char*, ModeStorage>>({{"f32", ModeStorage::f32}, {"f16", ModeStorage::f16}});
}

constexpr auto enum_list(ClusterPoint) {
  return std::to_array<std::pair<const char*, ClusterPoint>>(
      {{"random", ClusterPoint::random}, {"matched", ClusterPoint::matched}});
}

/// What the stress of a step comes from.
enum class StressKind {
  field,  ///< the stress field h(X, q, mu), and the affine velocity of its own field
  law     ///< the material's law: the points have deformation gradients and plastic state (GradientKind::integrated)
};

constexpr auto enum_list(StressKind) {
  return std::to_array<std::pair<const char*, StressKind>>({{"field", StressKind::field}, {"law", StressKind::law}});
}

struct NsfConfig {
  rom::FieldKind field = rom::FieldKind::factored;
  int64_t latents = 6;
  int64_t deformation_modes = 32, stress_modes = 64, affine_modes = 64;
  StressKind stress = StressKind::field;
  rom::AffineKind affine = rom::AffineKind::position;
  rom::BranchKind branch = rom::BranchKind::rbf;
  int64_t centers = 1000, affine_centers = 24;
  int64_t branch_width = 64, branch_steps = 3000, branch_batch = 128;
  double branch_learning_rate = 1e-2, branch_noise = 0.1;
  int64_t samples = 300;
  rom::SampleRule sample_rule = rom::SampleRule::random;
  Vec3d sample_low = Vec3d::filled(-1e30), sample_high = Vec3d::filled(1e30);
  double manifold_pull = 0;
  double step_factor = 1;
  int64_t cluster = 1;
  ClusterPoint cluster_point = ClusterPoint::matched;
  int64_t quadrature_snapshots = 16;
  int64_t encoder_particles = 2000;
  int64_t calibration_runs = 4;
  ModeStorage storage = ModeStorage::f16;
  double memory = 0;
  uint64_t seed = 0;
  MlpConfig mlp;

  static constexpr RemovedField removed[] = {
      {"quadrature", "\"mass\"", "fitted weights lost to matched points"},
      {"sample_windows", "[]", "samples that change with time gained nothing"},
      {"between_runs", "0", "states between runs gained less than another choice of samples"},
      {"outlier_factor", "0 0.0", "samples that count less gained nothing beside manifold_pull"}};

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = NsfConfig;
    visit(&C::field,
          FieldInfo{"field", "", "Fields: spatial modes and a regression (factored), or the paper's networks"});
    visit(&C::latents, FieldInfo{"latents", "", "Numbers of the latent state", Range::between(1, 32)});
    visit(&C::deformation_modes, FieldInfo{"deformation_modes", "", "Spatial modes of the deformation field, at most",
                                           Range::between(1, 512)});
    visit(&C::stress_modes,
          FieldInfo{"stress_modes", "", "Spatial modes of the stress field, at most", Range::between(1, 512)});
    visit(&C::affine_modes,
          FieldInfo{"affine_modes", "", "Spatial modes of the affine field, at most", Range::between(1, 512)});
    visit(&C::stress, FieldInfo{"stress", "",
                                "What the stress of a step comes from: a field of the model, or the material's law "
                                "whose deformation gradients the points keep"});
    visit(&C::affine, FieldInfo{"affine", "", "What the affine field follows: the latent's velocity, or its position"});
    visit(
        &C::branch,
        FieldInfo{"branch", "",
                  "What gives the coefficients of the modes: radial basis functions (rbf), or a small network (mlp)"});
    visit(&C::centers, FieldInfo{"centers", "", "Centres of the branches; every snapshot where there are no more",
                                 Range::between(0, 10000)});
    visit(&C::affine_centers,
          FieldInfo{"affine_centers", "", "Centres of the affine field's branch, when it follows the rate",
                    Range::between(0, 1000)});
    visit(&C::branch_width,
          FieldInfo{"branch_width", "", "Hidden width of a branch's network", Range::between(1, 1024)});
    visit(&C::branch_steps,
          FieldInfo{"branch_steps", "", "Steps of Adam that train a branch's network", Range::between(1, 1e7)});
    visit(&C::branch_batch, FieldInfo{"branch_batch", "", "Snapshots of such a step; all where there are no more",
                                      Range::between(1, 1e6)});
    visit(&C::branch_learning_rate,
          FieldInfo{"branch_learning_rate", "", "First learning rate of them; it falls to 0 as half a cosine",
                    Range::positive()});
    visit(&C::branch_noise, FieldInfo{"branch_noise", "",
                                      "Standard deviation of the noise on their inputs (standardised), which keeps a "
                                      "network flat beside the states of the training",
                                      Range::between(0, 10)});
    visit(&C::samples, FieldInfo{"samples", "", "Sample particles", Range::between(1, 1e6)});
    visit(&C::sample_rule, FieldInfo{"sample_rule", "", "How the samples are chosen"});
    visit(&C::sample_low,
          FieldInfo{"sample_low", "m", "Lower corner of the box of the reference body that samples lie in"});
    visit(&C::sample_high, FieldInfo{"sample_high", "m", "Upper corner of the samples' box"});
    visit(&C::manifold_pull,
          FieldInfo{"manifold_pull", "", "Share of the way back to the states of the training that a step takes",
                    Range::between(0, 1)});
    visit(&C::step_factor,
          FieldInfo{"step_factor", "", "Time steps of the model over those of its data, unless told otherwise",
                    Range::positive()});
    visit(&C::cluster, FieldInfo{"cluster", "", "So many particles that lie together are one integration point",
                                 Range::between(1, 1000)});
    visit(&C::cluster_point, FieldInfo{"cluster_point", "",
                                       "Which particle of a cluster is its integration point: a random one, or the one "
                                       "that matches the training's sums at grid nodes"});
    visit(&C::quadrature_snapshots,
          FieldInfo{"quadrature_snapshots", "", "Training snapshots that matched points are chosen by",
                    Range::between(1, 1000)});
    visit(&C::encoder_particles,
          FieldInfo{"encoder_particles", "", "Particles whose positions give the latent of a state, at most",
                    Range::between(1, 1e6)});
    visit(&C::calibration_runs,
          FieldInfo{"calibration_runs", "",
                    "Training runs that the model rolls out to learn what is usual (0: no verdict on trust)",
                    Range::between(0, 1000)});
    visit(&C::storage, FieldInfo{"storage", "", "How the weights file keeps the modes"});
    visit(&C::memory,
          FieldInfo{"memory", "GB",
                    "Memory for the snapshots of a field; more of them are read in blocks. 0: half of what is free",
                    Range::not_negative()});
    visit(&C::seed, FieldInfo{"seed", "", "Seed of samples, weights and batches"});
    visit(&C::mlp, FieldInfo{"mlp", "", "The paper's networks and their training"});
  }
};

}  // namespace graupel::train
