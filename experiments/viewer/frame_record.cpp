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

/// Whole numbers of vectors and of points: with the axes' constants repeated over them, loops need no shuffles.
constexpr std::size_t block_points = 16, block = 3 * block_points;

/// Of points that are all in the run: NaN compares as false, so that one shows in `finite` alone.
Extent extent_of_all(std::span<const Vec3f> position, bool& finite) {
  float low[block], high[block];
  std::fill(low, low + block, std::numeric_limits<float>::max());
  std::fill(high, high + block, -std::numeric_limits<float>::max());
  const float* x = position.empty() ? nullptr : position[0].a;
  int bad = 0;
  const std::size_t blocks = position.size() / block_points;
  for (std::size_t b = 0; b < blocks; ++b, x += block)
    for (std::size_t k = 0; k < block; ++k) {
      low[k] = x[k] < low[k] ? x[k] : low[k];
      high[k] = x[k] > high[k] ? x[k] : high[k];
      bad |= x[k] != x[k];
    }
  for (std::size_t k = 0; k < 3 * (position.size() % block_points); ++k) {
    low[k] = std::min(low[k], x[k]);
    high[k] = std::max(high[k], x[k]);
    bad |= x[k] != x[k];
  }
  finite = bad == 0;
  Extent extent;
  for (std::size_t k = 0; k < block; ++k) {
    extent.box.low[k % 3] = std::min(extent.box.low[k % 3], low[k]);
    extent.box.high[k % 3] = std::max(extent.box.high[k % 3], high[k]);
  }
  extent.shown = static_cast<uint32_t>(position.size());
  return extent;
}

Extent extent_of(const FrameToEncode& frame, const Box& limits) {
  if (frame.active.empty()) {
    bool finite = false;
    const Extent all = extent_of_all(frame.position, finite);
    if (finite && inside(all.box.low, limits) && inside(all.box.high, limits)) return all;
  }
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
  return static_cast<uint16_t>(static_cast<int32_t>(std::clamp((x - low) * per_step + 0.5f, 0.0f, last_step)));
}

/// All of them as if they were in the box.
void put_all_positions(std::span<const Vec3f> position, const Vec3f& low, const Vec3f& per_step, uint16_t* out) {
  float lows[block], scales[block];
  for (int k = 0; k < static_cast<int>(block); ++k) lows[k] = low[k % 3], scales[k] = per_step[k % 3];
  const float* x = position.empty() ? nullptr : position[0].a;
  for (std::size_t b = 0; b < position.size() / block_points; ++b, x += block, out += block)
    for (std::size_t k = 0; k < block; ++k) out[k] = steps_of(x[k], lows[k], scales[k]);
  for (std::size_t k = 0; k < 3 * (position.size() % block_points); ++k) out[k] = steps_of(x[k], lows[k], scales[k]);
}

void put_positions(const FrameToEncode& frame, const Extent& extent, const Vec3f& step, uint16_t* out) {
  Vec3f per_step;
  for (int d = 0; d < 3; ++d) per_step[d] = step[d] > 0 ? 1 / step[d] : 0;
  if (extent.shown == frame.position.size()) return put_all_positions(frame.position, extent.box.low, per_step, out);
  for (std::size_t i = 0; i < frame.position.size(); ++i, out += 3) {
    const Vec3f& x = frame.position[i];
    if (!inside(x, extent.box) || (!frame.active.empty() && frame.active[i] == 0)) {
      out[0] = out[1] = out[2] = absent_position;
      continue;
    }
    for (int d = 0; d < 3; ++d) out[d] = steps_of(x[d], extent.box.low[d], per_step[d]);
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
  put_positions(frame, extent, header.step, reinterpret_cast<uint16_t*>(at));
  return record;
}

}  // namespace graupel::experiments
