#include "train/commands/network_timing.h"

#include <algorithm>

#include "core/scene/particle_rows.h"
#include "core/system/error.h"
#include "graph/features/normalization.h"
#include "graph/plan/layer_plan.h"
#include "train/data/data_set.h"
#include "train/data/sampling.h"
#include "train/networks/network_module.h"
#include "train/parallel/blas_threads.h"

namespace graupel::train {

namespace {

SceneGraph newest_graph(const NetworkConfig& config, const graph::Normalization& normalization,
                        const DataSplit& split) {
  const TrajectoryInfo& trajectory = split.trajectory(0);
  const int64_t history = features_of(config).history;
  if (trajectory.frames < history + 1)
    throw InputError("'" + split.file() + "': trajectory 0 has too few frames (" + std::to_string(trajectory.frames) +
                     ", the network sees " + std::to_string(history + 1) + "). Give a longer one");
  const int64_t newest = trajectory.frames - 1;
  const std::vector<int32_t> present = trajectory.present(newest);
  if (present.empty())
    throw InputError("'" + split.file() + "': trajectory 0 has no particle in the run in its last frame (" +
                     std::to_string(newest) + "). Give one that has some");
  graph::MovingEnvironment moving_environment(trajectory.context->environment);
  return scene_graph(config, normalization, moving_environment.at(trajectory.context->time_of(newest + 1)),
                     trajectory.kinds(present), frame_rows(split.history(0, newest, history), present),
                     grid_origin(trajectory, config));
}

double flop_of(const NetworkConfig& config, const SceneGraph& graph, graph::FirstLayers first_layers) {
  if (const auto* hgn = std::get_if<graph::HgnConfig>(&config))
    return graph::flop_of(graph::plan_of(*hgn), graph::rows_of(graph.hierarchy), first_layers);
  return graph::flop_of(graph::plan_of(std::get<graph::GnsConfig>(config)),
                        {.particles = static_cast<int64_t>(graph.type_row.size()),
                         .moving = graph.moving(),
                         .level = {{.cells = 0, .edges = graph.links.edges()}}},
                        first_layers);
}

}  // namespace

NetworkTime time_network(const nn::Weights& weights, const std::string& file, const NetworkTimingOptions& options) {
  const NetworkConfig config = network_config_of(weights);
  configure_torch(options.threads, /*tf32=*/true);
  const BlasThreads blas(options.threads);
  NetworkModule module(config, options.device, 0);
  module.set_state(StateArray::weights, weights);
  DataSplitOptions split_options;
  split_options.threads = options.threads;
  split_options.materials = features_of(config).material_constants;
  split_options.check = [&](const DataSplit& opened) { opened.check_fits(config, weights.file); };
  const DataSplit split(file, split_options);
  const SceneGraph graph = newest_graph(config, graph::read_normalization(weights), split);

  NetworkTime time;
  time.architecture = architecture_of(config);
  time.particles = graph.moving();
  time.flop = flop_of(config, graph, options.first_layers);
  time.seconds = module
                     .time_prediction(concatenate({graph}), StateArray::weights, options.first_layers, options.warm_ups,
                                      options.runs)
                     .seconds;
  std::sort(time.seconds.begin(), time.seconds.end());
  return time;
}

}  // namespace graupel::train
