// Sound speeds of matter that emitters are about to send out, which steps must resolve from its first substep on.
#pragma once

#include <vector>

#include "core/scene/scene.h"
#include "mpm/particles/host_particles.h"
#include "mpm/phases/user_materials.h"
#include "mpm/sampling.h"

namespace graupel::mpm {

class EmittedSound {
 public:
  EmittedSound() = default;
  /// `initial` is the state in which `sampled` particles are born, by `materials` or `laws` (empty, or one a material).
  template <typename T>
  EmittedSound(const Scene& scene, const SampledParticles& sampled, const HostParticles<T>& initial,
               const std::vector<MaterialConfig>& materials, const UserLaws& laws);

  /// Of what appears at any time in [from, to] [m/s].
  double largest(double from, double to) const;

 private:
  std::vector<Emitter> emitters_;
  std::vector<double> sound_speed_;  ///< [emitters] largest of its particles at birth [m/s]
};

}  // namespace graupel::mpm
