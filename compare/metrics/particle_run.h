// One run of a scene as the comparison sees it: positions over time, with the mass and volume of each particle.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/trajectory.h"

namespace graupel::compare {

/// Frame 0 is the given start, frames 1.. are predicted. Metrics read positions and types; velocities are frame
/// differences, so that solvers and networks are treated alike.
struct ParticleRun {
  Trajectory trajectory;
  std::vector<double> mass;    ///< [n] [kg]
  std::vector<double> volume;  ///< [n] at rest [m^3]

  std::size_t size() const { return trajectory.particle_count(); }
  /// Number of predicted frames.
  std::size_t predicted() const { return trajectory.frames.empty() ? 0 : trajectory.frames.size() - 1; }
  /// Positions of frame f [m], shape [n, 3].
  const std::vector<Vec3f>& position(std::size_t f) const { return trajectory.frames[f].position; }
  /// Whether a particle is in the run in a frame.
  bool is_active(std::size_t f, std::size_t i) const { return trajectory.frames[f].is_active(i); }
  /// Whether any particle of a type is.
  bool has_type(std::size_t f, int32_t type) const;
};

/// Particle types present, ascending.
std::vector<int32_t> types_of(const Trajectory& trajectory);

/// Repeats the last usable frame until the run has `frames` predicted frames: what a diverged run counts as.
void hold_last_frame(Trajectory& trajectory, std::size_t frames);

/// 0 x, 1 y or 2 z: the axis that gravity points along most; y without gravity.
int vertical_axis(const Vec3d& gravity);

}  // namespace graupel::compare
