// Weights of every kind: read as the model that they name, and run for a frame or two.
#include <memory>
#include <variant>

#include "core/scene/material_config.h"
#include "graph/config/network_config.h"
#include "graph/learned_simulator.h"
#include "hybrid/coarse_model.h"
#include "io/scene/scene_reader.h"
#include "nn/weights.h"
#include "rom/reduced_solver.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/small_scene.h"
#include "tests/fuzz/weights_mutator.h"

namespace graupel::fuzz {

namespace {

constexpr double seed_frame_time = 1.0 / 60, seed_dx = 1.0 / 16;  ///< of the networks in corpus/safetensors
/// libFuzzer's build has a smaller box [m], since two thirds of the time of replaying went to the box's cells, and
/// reads networks of finer cells [m] without rolling them out: its sanitizers make a second of their millions of cells
/// a minute.
#ifdef GRAUPEL_LIBFUZZER
constexpr double edge = 0.5, least_spacing = 0.01;
#else
constexpr double edge = 1, least_spacing = 0;
#endif

/// Whether a rollout takes more than files of this size should in a test: a frame of millions of cells, or particles of
/// obstacles that each see hundreds of others.
bool is_costly(const graph::NetworkConfig& network) {
  const auto* gns = std::get_if<graph::GnsConfig>(&network);
  return graph::spacing_of(network) < least_spacing ||
         (gns != nullptr && gns->obstacle_particles && gns->obstacle_spacing < gns->radius / 10);
}

constexpr int64_t most_substeps = 1000;  ///< of a frame of a reduced model that is rolled out

Scene box_with_ball() {
  Scene scene;
  scene.domain.dx = seed_dx;
  scene.domain.size = {edge, edge, edge};
  scene.frame_time = seed_frame_time;
  scene.materials["water"] = *material_preset("water");
  scene.materials["water"].name = "water";
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.2 * edge;
  ball.position = {0.5 * edge, 0.4 * edge, 0.5 * edge};
  scene.obstacles.push_back(ball);
  return scene;
}

/// The ball is there for weights that fit it; others get an empty box of their frame time.
void run_network(const std::shared_ptr<const nn::Weights>& weights) {
  static const Scene usual_scene = box_with_ball();
  static const graph::Environment usual(usual_scene);
  const graph::LearnedSimulator simulator(weights);
  if (is_costly(graph::network_config_of(*weights))) return;
  const graph::FeatureConfig& config = simulator.config();
  const bool fits = config.frame_time == seed_frame_time && config.dx == seed_dx && !config.in_plane();
  Scene scene = usual_scene;
  if (!fits) {
    scene.obstacles.clear();
    scene.frame_time = config.frame_time;
    scene.domain.dimensions = static_cast<int>(config.dimensions);
  }
  std::vector<Vec3f> position;
  for (int i = 0; i < 12; ++i) {
    const auto step = static_cast<float>(i);
    const float depth = config.in_plane() ? 0.5f : 0.45f + 0.01f * step;
    position.push_back(Vec3f{0.4f + 0.013f * step, 0.7f - 0.007f * step, depth} * static_cast<float>(edge));
  }
  const std::vector<int32_t> type(position.size(), 5);
  const std::vector<Vec3f> velocity(position.size(), Vec3f{0.1f, -1, 0});
  const auto start =
      graph::start_history(position, velocity, scene.gravity, scene.frame_time, static_cast<int>(config.history) + 1);
  graph::LearnedSimulator::RolloutOptions options;
  options.frames = 2;
  if (fits)
    static_cast<void>(simulator.rollout(scene, usual, type, start, options));
  else
    static_cast<void>(simulator.rollout(scene, graph::Environment(scene), type, start, options));
}

void run_reduced(const nn::Weights& weights) {
  const rom::ReducedModel model = rom::ReducedModel::load(weights);
  const Scene scene = io::parse_stored_scene(model.scene_json, weights.file, weights.file);
  nn::Weights stored = model.store(nn::DType::f16);
  stored.file = "stored again";
  static_cast<void>(rom::ReducedModel::load(stored));
  const double substeps = scene.frame_time / model.frame_time * static_cast<double>(model.substeps_per_frame);
  if (!is_small(scene) || !(substeps / model.step_factor <= most_substeps)) return;
  std::vector<double> parameters;
  for (const rom::ModelParameter& p : model.parameters) parameters.push_back(p.low);
  rom::ReducedSolver<float> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), parameters, {});
  solver.advance_frame();
  static_cast<void>(solver.frame());
}

void run_safetensors(const std::string& bytes) {
  const auto weights = std::make_shared<const nn::Weights>(nn::read_safetensors(file_with(bytes, "input.safetensors")));
  if (rom::is_reduced_model(*weights))
    run_reduced(*weights);
  else if (hybrid::is_coarse_model(*weights))
    static_cast<void>(hybrid::CoarseModel::load(*weights));
  else
    run_network(weights);
}

}  // namespace

const Target targets::safetensors = {"safetensors", run_safetensors, mutate_weights};

}  // namespace graupel::fuzz
