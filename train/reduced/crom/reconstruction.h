// How well a deformation map reconstructs snapshots from their latents: positions, deformation gradients, velocities.
#pragma once

#include <Eigen/Core>

#include "rom/deformation/deformation.h"
#include "train/reduced/snapshot_set.h"

namespace graupel::train {

/// Roots of sums of squared errors over those of other squares, all particles of the snapshots.
struct ReconstructionErrors {
  double position = 0;      ///< over positions: the position error of CROM section 5, which depends on the origin
  double displacement = 0;  ///< the same errors over displacements
  double gradient = 0;      ///< of F, over F - I
  double velocity = 0;      ///< of dg/dq (q_n+1 - q_n) / dt, over (x_n+1 - x_n) / dt
};

/// `latents` [snapshots, r]; `stride`: every so many snapshots.
ReconstructionErrors reconstruction_errors(const rom::Deformation& map, const SnapshotSet& set,
                                           const Eigen::MatrixXd& latents, int64_t stride);

/// q' of every snapshot, the difference to the next frame of its run over its time; 0 in the last one, [snapshots, r].
Eigen::MatrixXd latent_rates(const SnapshotSet& set, const Eigen::MatrixXd& latents);

}  // namespace graupel::train
