// What the tests of rollouts on a GPU share: a case with its history, statistics, and weights read back from a file.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "graph/learned_simulator.h"
#include "random_input.h"

namespace graupel::graph {

inline Normalization wide_statistics() {
  Normalization n;
  for (int axis = 0; axis < 3; ++axis) {
    n.velocity_std[axis] = 0.01f;
    n.acceleration_std[axis] = 0.001f;
  }
  n.acceleration_mean[1] = -0.0027f;
  return n;
}

struct Case {
  Scene scene;
  std::vector<int32_t> type;
  std::vector<std::vector<Vec3f>> history;
};

/// Writes weights to a file of its own, which goes with the test.
class WeightsFile {
 public:
  WeightsFile() = default;
  ~WeightsFile() { std::filesystem::remove(path_); }
  WeightsFile(const WeightsFile&) = delete;
  WeightsFile& operator=(const WeightsFile&) = delete;
  LearnedSimulator read_back(const nn::Weights& weights) const {
    nn::write_safetensors(path_, weights);
    return LearnedSimulator(path_);
  }

 private:
  std::string path_ =
      (std::filesystem::temp_directory_path() / ("graupel_rollout_" + std::to_string(::getpid()) + ".safetensors"))
          .string();
};

}  // namespace graupel::graph
