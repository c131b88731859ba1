// Particles of the emitters: where and when each appears. All are known before the run, so that their number is fixed.
#pragma once

#include "mpm/sampling.h"

namespace graupel::mpm {

/// Particles of one emitter, ascending in time.
struct EmittedParticles {
  std::vector<Vec3d> position;  ///< place of birth [m]
  std::vector<double> time;     ///< of birth [s]
};

/// A stream is a lattice of particles behind the body that moves with the emitter's velocity; each particle appears
/// when it passes the body's front, so that no two particles are closer than in a body at rest. Bursts are samples of
/// the body. Depends on (seed, emitter index, particle index) alone. Throws ConfigError for a stream without velocity,
/// a rate or a sequence of bursts that would overlap what was sent out before, and more particles than the limit.
EmittedParticles sample_emitter(const Emitter& emitter, std::size_t index, const Domain& domain, uint64_t seed);

/// The emitter of a scene on `from` for the same scene on `to`, a grid of other spacing: its stream has the same volume
/// a second. It has `share` times as many particles a cell as before, or the nearest number whose lattice has room for
/// that flux; its rate says the rest. Bursts fill the same body.
Emitter with_flux_of(const Emitter& emitter, std::size_t index, const Domain& from, const Domain& to, double share = 1);

}  // namespace graupel::mpm
