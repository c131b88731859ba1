// Graph-network speed: frames of a shared scene, by part, beside the rate of a plain matrix product on the same
// threads.
#include <Eigen/Dense>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "bench/micro/micro.h"
#include "core/system/stopwatch.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"

namespace graupel::bench {

namespace {

/// Gflop/s of a 128-wide product over 64-row tiles on all threads: what the network's layers could reach.
double product_rate() {
  constexpr int width = 128, tile = 64, tiles = 2000;
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Matrix weight = Matrix::Random(width, width);
  std::vector<double> rates;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const Stopwatch watch;
#pragma omp parallel
    {
      Matrix x = Matrix::Random(tile, width), y = Matrix::Zero(tile, width);
#pragma omp for
      for (int t = 0; t < tiles; ++t) {
        y.noalias() += x * weight;
        x(t % tile, 0) = y(0, 0) * 1e-9f;
      }
    }
    const double seconds = watch.seconds();
    rates.push_back(2e-9 * width * width * tile * tiles / seconds);
  }
  return median(rates);
}

}  // namespace

nlohmann::ordered_json run_hgn(const std::string& weights, const std::string& scene_file) {
  const graph::LearnedSimulator simulator(weights);
  const Scene scene = io::read_scene(scene_file);
  const graph::Environment environment(scene);
  const auto particles = mpm::sample_sources(scene, scene.seed);
  std::vector<Vec3f> position, velocity;
  std::vector<int32_t> type;
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    position.push_back(particles.position[p].cast<float>());
    velocity.push_back(particles.velocity[p].cast<float>());
    type.push_back(particle_type_of(
        scene.materials.at(particles.material_names[static_cast<std::size_t>(particles.material[p])]).model));
  }
  const auto start = graph::start_history(position, velocity, scene.gravity, scene.frame_time,
                                          static_cast<int>(simulator.config().history) + 1);
  std::vector<double> total, hierarchy, network, features;
  graph::LearnedSimulator::RolloutOptions options;
  options.frames = 60;
  options.progress = [&](int64_t frame, const graph::FrameTiming& timing) {
    if (frame < 10) return;  // warm-up
    total.push_back(timing.total());
    hierarchy.push_back(timing.hierarchy);
    network.push_back(timing.network);
    features.push_back(timing.features + timing.projection);
  };
  simulator.rollout(scene, environment, type, start, options);
  const double rate = product_rate();
  std::printf("\n%s on %s: %zu particles, %d threads\n", weights.c_str(), scene.name.c_str(), type.size(),
              num_threads());
  std::printf(
      "frame %.1f ms: features and projection %.1f, hierarchy %.1f, network %.1f; a plain product reaches %.0f "
      "Gflop/s\n",
      1e3 * median(total), 1e3 * median(features), 1e3 * median(hierarchy), 1e3 * median(network), rate);
  return {{"weights", weights},
          {"scene", scene.name},
          {"particles", type.size()},
          {"threads", num_threads()},
          {"seconds_per_frame", median(total)},
          {"features", median(features)},
          {"hierarchy", median(hierarchy)},
          {"network", median(network)},
          {"product_gflops", rate}};
}

}  // namespace graupel::bench
