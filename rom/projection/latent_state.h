// The state of a reduced-order model: where it is on the manifold of its fields, and how fast it moves along it.
#pragma once

#include <vector>

namespace graupel::rom {

/// Parts of the training's curve before and behind the present time among which the nearest point is looked for
/// (rom/projection/latent_manifold.h).
inline constexpr int curve_window = 3;

struct LatentState {
  std::vector<double> latent;      ///< q [r], without unit
  std::vector<double> velocity;    ///< q' [r] [1/s]
  std::vector<double> parameters;  ///< mu [p], in the units of the scene
  double last_step = 0;            ///< over which the velocity was taken [s]; 0 at the start
  std::vector<double> previous;    ///< q one step before [r]; empty at the start
};

}  // namespace graupel::rom
