// A frame as the viewer's page gets it: positions as 16-bit steps in the box of the frame. All frames of a run have the
// same number of bytes, so that ranges of bytes are frames:
//   f32 low[3], step[3] [m], time [s]; u32 particles left out, number of the run; then for each obstacle that moves
//   f32 rotation[9] (by rows), translation[3] [m], from its pose at time 0; then u16 [particles, 3].
// x = low + step q with q <= 65534, off by half a step at most; q = 65535 on all axes: not in the run, or left out.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/motion.h"

namespace graupel::experiments {

struct Box {
  Vec3f low, high;  ///< [m]
};

struct FrameToEncode {
  double time = 0;                      ///< [s]
  std::span<const Vec3f> position;      ///< [m]
  std::span<const uint8_t> active;      ///< [particles], or empty: all are in the run
  std::vector<RigidMap> obstacle_pose;  ///< of those that move
  uint32_t run = 0;
};

inline constexpr uint16_t absent_position = 65535;

std::size_t frame_record_bytes(std::size_t particles, std::size_t moving_obstacles);

/// Particles outside of `limits` are left out, and those that are not finite: one that flew away would take the
/// resolution from the others.
std::vector<std::byte> encode_frame(const FrameToEncode& frame, const Box& limits);

}  // namespace graupel::experiments
