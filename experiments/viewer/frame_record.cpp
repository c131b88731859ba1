#include "experiments/viewer/frame_record.h"

#include <algorithm>
#include <cstring>
#include <limits>

namespace graupel::experiments {

namespace {

constexpr float last_step = absent_position - 1;

struct Header {
  Vec3f low, step;
  float time;
  uint32_t left_out, run;
};
static_assert(sizeof(Header) == 36);
constexpr std::size_t pose_bytes = 12 * sizeof(float);

/// False for NaN.
bool inside(const Vec3f& x, const Box& box) {
  return x[0] >= box.low[0] && x[0] <= box.high[0] && x[1] >= box.low[1] && x[1] <= box.high[1] && x[2] >= box.low[2] &&
         x[2] <= box.high[2];
}

struct Extent {
  Box box = {Vec3f::filled(std::numeric_limits<float>::max()), Vec3f::filled(-std::numeric_limits<float>::max())};
  uint32_t shown = 0, left_out = 0;
};

Extent extent_of(const FrameToEncode& frame, const Box& limits) {
  Extent extent;
  for (std::size_t i = 0; i < frame.position.size(); ++i) {
    if (!frame.active.empty() && frame.active[i] == 0) continue;
    const Vec3f& x = frame.position[i];
    if (!inside(x, limits)) {
      ++extent.left_out;
      continue;
    }
    ++extent.shown;
    for (int d = 0; d < 3; ++d) {
      extent.box.low[d] = std::min(extent.box.low[d], x[d]);
      extent.box.high[d] = std::max(extent.box.high[d], x[d]);
    }
  }
  if (extent.shown == 0) extent.box = limits;
  return extent;
}

void put_pose(const RigidMap& pose, std::byte* out) {
  float numbers[12];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) numbers[3 * r + c] = static_cast<float>(pose.rotation(r, c));
    numbers[9 + r] = static_cast<float>(pose.translation[r]);
  }
  std::memcpy(out, numbers, sizeof numbers);
}

uint16_t steps_of(float x, float low, float per_step) {
  return static_cast<uint16_t>(std::min((x - low) * per_step + 0.5f, last_step));
}

void put_positions(const FrameToEncode& frame, const Box& shown, const Vec3f& step, uint16_t* out) {
  Vec3f per_step;
  for (int d = 0; d < 3; ++d) per_step[d] = step[d] > 0 ? 1 / step[d] : 0;
  for (std::size_t i = 0; i < frame.position.size(); ++i, out += 3) {
    const Vec3f& x = frame.position[i];
    if (!inside(x, shown) || (!frame.active.empty() && frame.active[i] == 0)) {
      out[0] = out[1] = out[2] = absent_position;
      continue;
    }
    for (int d = 0; d < 3; ++d) out[d] = steps_of(x[d], shown.low[d], per_step[d]);
  }
}

}  // namespace

std::size_t frame_record_bytes(std::size_t particles, std::size_t moving_obstacles) {
  return sizeof(Header) + pose_bytes * moving_obstacles + 3 * sizeof(uint16_t) * particles;
}

std::vector<std::byte> encode_frame(const FrameToEncode& frame, const Box& limits) {
  std::vector<std::byte> record(frame_record_bytes(frame.position.size(), frame.obstacle_pose.size()));
  const Extent extent = extent_of(frame, limits);
  const Header header = {extent.box.low, (extent.box.high - extent.box.low) * (1 / last_step),
                         static_cast<float>(frame.time), extent.left_out, frame.run};
  std::memcpy(record.data(), &header, sizeof header);
  std::byte* at = record.data() + sizeof header;
  for (const RigidMap& pose : frame.obstacle_pose) {
    put_pose(pose, at);
    at += pose_bytes;
  }
  put_positions(frame, extent.box, header.step, reinterpret_cast<uint16_t*>(at));
  return record;
}

}  // namespace graupel::experiments
