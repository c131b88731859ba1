// Reads a record as the page does.
#pragma once

#include <cstring>
#include <span>
#include <vector>

#include "experiments/viewer/frame_record.h"

namespace graupel::test {

struct ReadFrame {
  Vec3f low, step;
  float time;
  uint32_t left_out, run;
  std::vector<float> poses;
  std::vector<uint16_t> steps;

  bool is_absent(std::size_t i) const { return steps[3 * i] == experiments::absent_position; }
  Vec3f position(std::size_t i) const {
    Vec3f x;
    for (int d = 0; d < 3; ++d)
      x[d] = low[d] + step[d] * static_cast<float>(steps[3 * i + static_cast<std::size_t>(d)]);
    return x;
  }
};

inline ReadFrame read_frame(std::span<const std::byte> bytes, std::size_t moving_obstacles = 0) {
  ReadFrame frame;
  std::memcpy(&frame.low, bytes.data(), 24);
  std::memcpy(&frame.time, bytes.data() + 24, 4);
  std::memcpy(&frame.left_out, bytes.data() + 28, 4);
  std::memcpy(&frame.run, bytes.data() + 32, 4);
  frame.poses.resize(12 * moving_obstacles);
  std::memcpy(frame.poses.data(), bytes.data() + 36, 4 * frame.poses.size());
  const auto positions = bytes.subspan(36 + 4 * frame.poses.size());
  frame.steps.resize(positions.size() / 2);
  std::memcpy(frame.steps.data(), positions.data(), positions.size());
  return frame;
}

}  // namespace graupel::test
