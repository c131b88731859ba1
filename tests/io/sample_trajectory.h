// A small trajectory whose every number is known.
#pragma once

#include <cmath>

#include "core/scene/trajectory.h"

namespace graupel {

inline ParticleFrame sample_frame(std::size_t particles, int frame) {
  ParticleFrame out;
  out.time = 0.1 * (frame + 1);
  for (std::size_t p = 0; p < particles; ++p) {
    const float s = static_cast<float>(p) + 0.5f * static_cast<float>(frame);
    out.position.push_back({std::sin(s), std::cos(2 * s), 0.01f * s});
    out.velocity.push_back({s, -s, 1});
  }
  return out;
}

/// Types 5, 6, 8, 4, 5, ...; without frames.
inline Trajectory sample_header(std::size_t particles) {
  Trajectory out;
  const int32_t types[] = {5, 6, 8, 4};
  for (std::size_t p = 0; p < particles; ++p) out.particle_type.push_back(types[p % 4]);
  out.frame_time = 0.1;
  out.scene_json = "{\"name\": \"sample \xc3\xbc\"}";
  out.seed = 0xfedcba9876543210u;
  out.made_by = "mpm";
  return out;
}

inline bool same_frame(const ParticleFrame& a, const ParticleFrame& b) {
  return a.time == b.time && a.position == b.position && a.velocity == b.velocity;
}

}  // namespace graupel
