// A small series of positions whose every number is known, and exact in f32.
#pragma once

#include "io/particle_series.h"

namespace graupel::io {

/// x[t, p, axis] = shift + t + p / 4 + axis / 16; types 5, 6, 5, 6, ...
inline ParticleSeries sample_series(int64_t frames, int64_t particles, int dimensions, float shift = 0) {
  ParticleSeries series;
  series.where = "sample";
  series.frames = frames;
  series.particles = particles;
  series.dimensions = dimensions;
  for (int64_t t = 0; t < frames; ++t)
    for (int64_t p = 0; p < particles; ++p)
      for (int axis = 0; axis < dimensions; ++axis)
        series.position.push_back(shift + static_cast<float>(t) + 0.25f * static_cast<float>(p) +
                                  0.0625f * static_cast<float>(axis));
  for (int64_t p = 0; p < particles; ++p) series.particle_type.push_back(5 + p % 2);
  return series;
}

inline bool same_values(const ParticleSeries& a, const ParticleSeries& b) {
  return a.dimensions == b.dimensions && a.frames == b.frames && a.particles == b.particles &&
         a.position == b.position && a.particle_type == b.particle_type && a.material_property == b.material_property;
}

}  // namespace graupel::io
