// Modes of a deformation map from snapshots: displacements x - X and F - I of every particle as linear functions of the
// latents, and of these the smooth modes on a lattice whose values and gradients are nearest.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "rom/deformation/mode_deformation.h"
#include "train/reduced/sweep_snapshots.h"

namespace graupel::train {

struct ModeFit {
  double spacing = 0;          ///< of the lattice [m]
  Vec3d origin;                ///< of MPM's grid [m]; nodes lie at whole spacings from it
  double gradient_weight = 0;  ///< [m^2] of the squared error of du/dX, that of u being 1
};

/// `latents` [snapshots, r]; `rest` [r], those of the reference body. Reads all snapshots' positions and gradients by
/// blocks. Throws ConfigError when the lattice would be larger than the memory for it.
rom::ModeDeformation fit_modes(const SweepSnapshots& snapshots, const Eigen::MatrixXd& latents,
                               const std::vector<double>& rest, const ModeFit& fit);

}  // namespace graupel::train
