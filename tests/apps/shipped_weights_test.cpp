// Every shipped weights file loads without libtorch and predicts a shared scene as well as its card says.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "graph/learned_simulator.h"
#include "io/scene_reader.h"
#include "mpm/simulation.h"

namespace graupel {
namespace {

constexpr int64_t frames = 20;

/// Mean over particles and predicted frames of the squared distance [m^2] between prediction and MPM.
double rollout_error(const std::string& weights, const std::string& scene_file) {
  const Scene scene = io::read_scene(scene_file);
  mpm::SimulationOptions options;
  options.seed = scene.seed;
  const auto truth = mpm::Simulation::create(scene, options);
  const ParticleFrame start = truth->frame();
  const graph::LearnedSimulator simulator(weights);
  const graph::Surroundings surroundings(scene);
  graph::LearnedSimulator::RolloutOptions rollout;
  rollout.frames = frames;
  const Trajectory predicted =
      simulator.rollout(scene, surroundings, truth->particle_type(),
                        graph::start_history(start.position, start.velocity, scene.gravity, scene.frame_time,
                                             static_cast<int>(simulator.config().history) + 1),
                        rollout);
  EXPECT_EQ(predicted.diverged_at_frame, -1);
  double sum = 0;
  for (std::size_t f = 1; f <= frames; ++f) {
    truth->advance_frame();
    const ParticleFrame frame = truth->frame();
    for (std::size_t p = 0; p < frame.position.size(); ++p)
      sum += norm2((predicted.frames[f].position[p] - frame.position[p]).cast<double>());
  }
  return sum / static_cast<double>(frames) / static_cast<double>(predicted.particle_count());
}

TEST(ShippedWeights, RollOutAsWellAsTheirCardsSay) {
  const std::filesystem::path models = GRAUPEL_SOURCE_DIR "/models";
  int checked = 0;
  for (const auto& entry : std::filesystem::directory_iterator(models)) {
    if (entry.path().extension() != ".safetensors") continue;
    const auto card = nlohmann::json::parse(read_file(models / (entry.path().stem().string() + ".json")));
    const std::string scene = GRAUPEL_SOURCE_DIR "/" + card.at("check").at("scene").get<std::string>();
    const double expected = card.at("check").at("position_mse_20_frames").get<double>();
    const double error = rollout_error(entry.path(), scene);
    EXPECT_LE(error, 1.5 * expected) << entry.path() << " on " << scene;
    EXPECT_GT(error, 0.0);
    ++checked;
  }
  EXPECT_GE(checked, 1);
}

}  // namespace
}  // namespace graupel
