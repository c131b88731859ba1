// Time of a frame of graph networks beside that of MPM, on scenes of many sizes.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/graph/graph_options.h"
#include "bench/graph/libtorch_time.h"
#include "experiments/models/model_choice.h"
#include "experiments/models/mpm_run.h"
#include "experiments/models/network_run.h"

namespace graupel::bench {

using namespace experiments;

/// One model at one state of one scene.
struct GraphBenchRow {
  std::string state, model;
  std::size_t particles = 0;
  int64_t scenes = 1;  ///< that advance at once; the cost is that of one of them
  compare::RunCost cost = {};
  double flop = 0;                            ///< of the network, a frame in the middle of the run; 0 for MPM
  std::optional<LibtorchTime> libtorch = {};  ///< of a row that is the network there; its cost is that alone
  /// Of networks on several scenes, by frames of a rollout: time of a frame of one scene with all that starts and
  /// results take [s].
  std::map<int64_t, double> whole = {};
  double over_engine = 0;  ///< of such a row: its time over the whole frame of Graupel's engine

  std::string label() const;
  double flop_per_second() const { return cost.network > 0 ? flop / cost.network : 0; }
};

/// The models of --models. Throws ConfigError for those that are no whole network and no form of MPM, or that cannot
/// run on the device.
class GraphBench {
 public:
  GraphBench(const BenchGraphOptions& options, Device device);

  /// A scene as it starts to fall, and at rest on the floor, where the particles are spread.
  std::vector<GraphBenchRow> measure(int64_t particles);

 private:
  std::vector<GraphBenchRow> measure_state(const Scene& scene, const std::string& state);
  /// Completes and appends the row of a network and, with --libtorch, appends those of the same network there.
  void measure_network(const graph::LearnedSimulator& network, const Scene& scene,
                       const graph::Environment& environment, const StartState& start, GraphBenchRow row,
                       std::vector<GraphBenchRow>& rows) const;
  /// Appends its rows with --batch.
  void measure_many(const graph::LearnedSimulator& network, const Scene& scene, const graph::Environment& environment,
                    GraphBenchRow row, std::vector<GraphBenchRow>& rows) const;

  const BenchGraphOptions& options_;
  Device device_;
  std::string scene_json_;  ///< of the scene that is being measured
  std::vector<ModelChoice> choices_;
  std::vector<std::shared_ptr<const graph::LearnedSimulator>> networks_;
};

}  // namespace graupel::bench
