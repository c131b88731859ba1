// A scene of its own and networks for the tests of `graupel compare`.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "experiments/comparison/compare_runs.h"
#include "experiments/models/mpm_run.h"
#include "nn/weights.h"
#include "tests/graph/random_weights.h"

namespace graupel::experiments {

/// Some 200 particles of water and sand that fall on a sphere.
inline constexpr const char* small_scene = R"({
  "name": "small",
  "seed": 3,
  "domain": { "size": [1, 1, 1], "dx": 0.03125 },
  "materials": { "water": { "preset": "water", "bulk_modulus": 1e4 }, "sand": { "preset": "sand", "youngs_modulus": 1e5 } },
  "sources": [
    { "shape": "box", "size": [0.09, 0.09, 0.09], "position": [0.5, 0.5, 0.5], "material": "water", "velocity": [0, -1, 0] },
    { "shape": "box", "size": [0.09, 0.09, 0.09], "position": [0.3, 0.7, 0.6], "material": "sand" }
  ],
  "obstacles": [ { "shape": "sphere", "radius": 0.15, "position": [0.5, 0.26, 0.5] } ],
  "frames": 10
})";

class CompareRuns : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "graupel_compare_XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    scene_ = folder_ + "/small.json";
    std::ofstream(scene_) << small_scene;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  CompareOptions options(const std::vector<std::string>& models) const {
    CompareOptions o;
    o.scenes = {scene_};
    o.models = models;
    o.threads = 1;
    return o;
  }

  /// A network whose acceleration is g dt^2 whatever it sees.
  std::string ballistic_network() const {
    return constant_network("ballistic", {0, static_cast<float>(-9.8 / 3600), 0});
  }
  /// A network that gives this acceleration [m/frame^2] whatever it sees.
  std::string constant_network(const std::string& name, const Vec3f& acceleration) const {
    graph::HgnConfig config;
    config.latent = 8;
    config.levels = 2;
    config.message_passing = 1;
    config.dx = 0.03125;
    graph::Normalization normalization;
    for (int d = 0; d < 3; ++d) normalization.acceleration_mean[d] = acceleration[d];
    auto weights = graph::random_weights(config, normalization);
    graph::silence_decoder(weights);
    const std::string path = folder_ + "/" + name + ".safetensors";
    nn::write_safetensors(path, weights);
    return path;
  }

  std::string folder_, scene_;
};

inline MpmRunOptions seeded(int64_t frames) {
  MpmRunOptions options;
  options.seed = 3;
  options.frames = frames;
  return options;
}

/// The small scene with more in it: `extra` are members of the scene, `domain` of its domain.
inline std::string scene_with(const std::string& name, const std::string& extra, const std::string& domain = "") {
  std::string text = small_scene;
  text.replace(text.find("\"small\""), 7, "\"" + name + "\"");
  text.insert(text.find("\"seed\""), extra);
  if (!domain.empty()) text.insert(text.find("\"dx\""), domain);
  return text;
}

inline constexpr const char* stream =
    R"("emitters": [ { "shape": "box", "size": [0.1, 0.04, 0.1], "position": [0.7, 0.8, 0.4],
  "material": "water", "velocity": [0, -2, 0], "start_time": 0.02, "end_time": 0.12 } ],
  "sinks": [ { "shape": "half_space", "normal": [0, 1, 0], "position": [0, 0.5, 0] } ], )";

}  // namespace graupel::experiments
