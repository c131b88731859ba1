// Positions come back to half a step; what is not in the run, not finite or far away is marked.
#include "experiments/viewer/frame_record.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/viewer/frame_reader.h"

namespace graupel::experiments {
namespace {

const Box limits = {Vec3f{-1, -1, -1}, Vec3f{2, 2, 2}};

std::vector<Vec3f> points(std::size_t count) {
  std::vector<Vec3f> x;
  for (std::size_t i = 0; i < count; ++i) {
    const auto t = static_cast<float>(i);
    x.push_back({0.5f + 0.4f * std::sin(1.1f * t), 0.3f + 0.2f * std::cos(2.3f * t), 0.7f * std::sin(0.7f * t)});
  }
  return x;
}

TEST(FrameRecord, PositionsAreOffByHalfAStepAtMost) {
  const std::vector<Vec3f> x = points(5000);
  FrameToEncode frame;
  frame.time = 0.25;
  frame.position = x;
  frame.run = 7;
  const auto record = encode_frame(frame, limits);
  ASSERT_EQ(record.size(), frame_record_bytes(x.size(), 0));
  EXPECT_EQ(record.size(), 36 + 6 * x.size());
  const test::ReadFrame read = test::read_frame(record);
  EXPECT_EQ(read.time, 0.25f);
  EXPECT_EQ(read.run, 7u);
  EXPECT_EQ(read.left_out, 0u);
  for (int d = 0; d < 3; ++d) EXPECT_LT(read.step[d], 1.5f / 65534);
  for (std::size_t i = 0; i < x.size(); ++i) {
    ASSERT_FALSE(read.is_absent(i));
    for (int d = 0; d < 3; ++d) EXPECT_LE(std::abs(read.position(i)[d] - x[i][d]), 0.5f * read.step[d] + 2e-7f);
  }
}

TEST(FrameRecord, WhatIsNotShownTakesNoResolution) {
  std::vector<Vec3f> x = points(100);
  x[3] = {1e6f, 0, 0};
  x[4] = {NAN, 0, 0};
  x[5] = {0, INFINITY, 0};
  x[6] = {0.5f, -1e4f, 0.5f};
  std::vector<uint8_t> active(x.size(), 1);
  active[6] = active[7] = 0;
  FrameToEncode frame;
  frame.position = x;
  frame.active = active;
  const test::ReadFrame read = test::read_frame(encode_frame(frame, limits));
  EXPECT_EQ(read.left_out, 3u);
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(read.is_absent(i), i >= 3 && i <= 7) << i;
  EXPECT_LT(read.step[0], 1.5f / 65534);
}

TEST(FrameRecord, FlatAndEmptyFrames) {
  const std::vector<Vec3f> x = {{0.5f, 0.25f, 0.5f}, {0.75f, 0.25f, 0.5f}};
  FrameToEncode frame;
  frame.position = x;
  const test::ReadFrame read = test::read_frame(encode_frame(frame, limits));
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(read.position(i), x[i]);
  const std::vector<uint8_t> none(2, 0);
  frame.active = none;
  EXPECT_TRUE(test::read_frame(encode_frame(frame, limits)).is_absent(0));
}

TEST(FrameRecord, HoldsThePosesOfMovingObstacles) {
  FrameToEncode frame;
  const std::vector<Vec3f> x = points(3);
  frame.position = x;
  frame.obstacle_pose.push_back({Mat3d::identity(), {1, 2, 3}});
  const auto record = encode_frame(frame, limits);
  EXPECT_EQ(record.size(), frame_record_bytes(3, 1));
  EXPECT_EQ(test::read_frame(record, 1).poses, (std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 2, 3}));
}

}  // namespace
}  // namespace graupel::experiments
