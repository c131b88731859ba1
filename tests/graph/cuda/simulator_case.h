// A small network in a file and its rollouts, for the tests of learned simulators.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "graph/learned_simulator.h"
#include "tests/graph/random_input.h"

namespace graupel::graph {

inline constexpr double gravity = -9.8, frame_time = 1.0 / 60;

inline HgnConfig small_config() {
  HgnConfig config;
  config.latent = 16;
  config.levels = 2;
  config.message_passing = 2;
  config.embedding = 4;
  config.history = 3;
  return config;
}

/// Mean acceleration = gravity, so that a network whose output is 0 predicts free flight.
inline Normalization free_flight() {
  Normalization n;
  n.acceleration_mean[1] = static_cast<float>(gravity * frame_time * frame_time);
  for (int axis = 0; axis < 3; ++axis) {
    n.velocity_std[axis] = 0.01f;
    n.acceleration_std[axis] = 0.001f;
  }
  return n;
}

class LearnedSimulatorTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("graupel_simulator_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "net.safetensors").string();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  LearnedSimulator make(nn::Weights weights) const {
    nn::write_safetensors(path_, weights);
    return LearnedSimulator(path_);
  }
  LearnedSimulator make_ballistic() const {
    nn::Weights weights = random_weights(small_config(), free_flight());
    silence_decoder(weights);
    return make(weights);
  }

  std::filesystem::path folder_;
  std::string path_;
};

}  // namespace graupel::graph
