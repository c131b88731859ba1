// Particle state on the host, one record a particle: for making, reading, saving and judging states.
#pragma once

#include <vector>

#include "mpm/particles/particles.h"
#include "mpm/sampling.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

/// Arrays in slot order; meanings as in ParticleView.
template <typename T>
struct HostParticles {
  std::vector<Vec<T, 3>> position, velocity;
  std::vector<Mat<T, 3>> affine_velocity, deformation_gradient;
  std::vector<Vec<T, 6>> stress;  ///< xx, yy, zz, xy, xz, yz
  std::vector<T> internal, volume;
  std::vector<int32_t> material, source_index;

  explicit HostParticles(std::size_t n = 0);
  std::size_t size() const { return position.size(); }
};

/// Particles with the stress of their deformation, which is none where they are undeformed, in source order.
template <typename T>
HostParticles<T> initial_particles(const SampledParticles& sampled, const std::vector<MaterialConfig>& materials);

template <typename T>
Particles<T> upload_particles(const HostParticles<T>& host, Device device);
template <typename T>
HostParticles<T> download_particles(Particles<T>& particles);

/// Marks the particles that are `active` (by source index; empty: all are); the others do not move.
void set_active(ParticleFrame& frame, std::vector<uint8_t> active);

/// The `wanted` fields in the order of the sources. Particles that are not `active` (by source index; empty: all are)
/// have no stress and no affine velocity.
template <typename T>
ParticleFields fields_of(const HostParticles<T>& particles, FieldSet wanted, const std::vector<uint8_t>& active = {});

/// Sums in f64, over the particles that are `active` (by source index; empty: all), with gravity at `time` [s].
template <typename T>
Diagnostics diagnose(const HostParticles<T>& particles, const std::vector<MaterialConfig>& materials,
                     const Scene& scene, const std::vector<uint8_t>& active = {}, double time = 0);

}  // namespace graupel::mpm
