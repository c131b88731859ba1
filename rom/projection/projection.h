// From the samples' positions and velocities after a grid step to the next latent state: how the solver's step is
// brought back to the manifold of its deformation map.
#pragma once

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

#include "core/scene/fields.h"
#include "rom/projection/gauss_newton.h"
#include "rom/projection/latent_state.h"

namespace graupel::rom {

enum class ProjectionKind {
  position,           ///< q of the positions; q' is its change over the step (NSF eq. 10)
  position_velocity,  ///< q' of the velocities in the tangent space, q of the positions (CROM algorithm 6)
  velocity            ///< q' of the velocities; q moves by dt q' (CROM algorithm 7)
};

constexpr auto enum_list(ProjectionKind) {
  return std::to_array<std::pair<const char*, ProjectionKind>>(
      {{"position", ProjectionKind::position},
       {"position_velocity", ProjectionKind::position_velocity},
       {"velocity", ProjectionKind::velocity}});
}

/// The samples after a step.
struct SampleMotion {
  Eigen::VectorXd before, after;  ///< positions [3 samples] [m]
  std::vector<double> weight;     ///< of each sample in the fit; 0: the step threw it off, it does not count
};

/// Moves `state` by dt [s]: latent and velocity, and with ProjectionKind::position the step that the velocity is a
/// difference over. `iterations` of Gauss-Newton for positions. Throws DivergedError as fit_latent().
FitReport project(ProjectionKind kind, SampleField& field, const SampleMotion& motion, double dt, int iterations,
                  LatentState& state);

}  // namespace graupel::rom
