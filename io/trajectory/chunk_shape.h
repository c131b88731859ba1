// How much of a trajectory is one chunk of its file.
#pragma once

#include <hdf5.h>

#include <algorithm>
#include <cstdint>

#include "core/math/vec.h"

namespace graupel::io {

inline constexpr int64_t largest_chunk_bytes = int64_t(4) << 20;
inline constexpr int64_t most_chunk_frames = 8;
inline constexpr int64_t position_bytes = sizeof(Vec3f);  ///< of a particle
inline constexpr hsize_t time_chunk = 512;                ///< [frames]
static_assert(sizeof(Vec3f) == 3 * sizeof(float));

/// A chunk is written whole, so no later than at a flush.
inline hsize_t frames_in_a_chunk(hsize_t particles, int flush_every) {
  const int64_t fitting = largest_chunk_bytes / (static_cast<int64_t>(particles) * position_bytes);
  return static_cast<hsize_t>(
      std::clamp<int64_t>(fitting, 1, std::min<int64_t>(most_chunk_frames, std::max(flush_every, 1))));
}

/// Of values of `bytes` a particle and frame; of small ones as many as of positions.
inline hsize_t particles_in_a_chunk(hsize_t particles, hsize_t chunk_frames, int64_t bytes) {
  const int64_t fitting = largest_chunk_bytes / (static_cast<int64_t>(chunk_frames) * std::max(bytes, position_bytes));
  return std::min<hsize_t>(particles, static_cast<hsize_t>(fitting));
}

}  // namespace graupel::io
