// GNS: encoders of particles and edges, message passing between the particles, decoder. Edges have the only arrays that
// grow with their number: one latent and two indices each; everything else of an edge lives in a thread's scratch.
#include <algorithm>

#include "graph/cpu/engine.h"
#include "graph/cpu/lap_timer.h"
#include "graph/cpu/layer_weights.h"
#include "graph/cpu/messages/message_passing.h"
#include "graph/cpu/messages/particle_codec.h"
#include "graph/cpu/workspace_pool.h"
#include "graph/topology/gns_graph.h"

namespace graupel::graph {

namespace {

class EdgeEncoder {
 public:
  EdgeEncoder(const nn::Weights& weights, const PlanLayer& layer) : slope_(static_cast<float>(layer.slope)) {
    const nn::FcnWeights fcn = load(weights, layer);
    first_ = fcn.first_layer_part(0, edge_feature_count, nn::FcnWeights::Bias::with);
    middle_ = nn::MiddleLayers(fcn, slope_);
    last_ = nn::NormalizedLayer(fcn);
  }

  void apply(const GraphTopology& topology, double radius, Workspace& workspace) const {
    const int width = last_.width();
    const HostLinks& links = topology.levels[0];
    for_each_range(workspace, links.edges, tile_rows, [&](int32_t begin, int32_t end, TileScratch& scratch) {
      const int rows = end - begin;
      for (int r = 0; r < rows; ++r) {
        const auto e = static_cast<std::size_t>(begin + r);
        write_edge_features(topology.position[static_cast<std::size_t>(links.sender[e])],
                            topology.position[static_cast<std::size_t>(links.receiver[e])], radius,
                            scratch.input.data() + r * edge_feature_count);
      }
      first_.apply(scratch.input.data(), edge_feature_count, rows, scratch.hidden.data(), width);
      for (int r = 0; r < rows; ++r) nn::activate_row(scratch.hidden.data() + r * width, width, slope_);
      float* latent = workspace.edge.data() + static_cast<int64_t>(begin) * width;
      last_.apply(middle_.apply(scratch.hidden.data(), scratch.output.data(), rows), rows, latent);
      for (int r = 0; r < rows; ++r) last_.finish(latent + static_cast<int64_t>(r) * width);
    });
  }

 private:
  float slope_;
  nn::Linear first_;
  nn::MiddleLayers middle_;
  nn::NormalizedLayer last_;
};

class GnsEngine : public CpuEngine {
 public:
  GnsEngine(const LayerPlan& plan, const nn::Weights& weights, double radius)
      : width_(width_of(plan)),
        inputs_(inputs_of(plan)),
        radius_(radius),
        particles_(weights, plan),
        edges_(weights, plan.layers[1]),
        steps_(weights, plan, plan.blocks[0]),
        decoder_(weights, plan) {}

  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const std::vector<Vec3f>& position, const Vec3d&, std::vector<float>& acceleration,
                FrameTiming& timing) const override {
    LapTimer watch;
    auto workspace = workspaces_.take();
    workspace->topology.build(position, radius_);
    timing.hierarchy += watch.lap();
    run(features, particle_type, *workspace, acceleration);
    timing.network += watch.lap();
    workspaces_.give_back(std::move(workspace));
  }
  PlanRows rows(const std::vector<Vec3f>& position, const Vec3d&) const override {
    GraphTopology topology;
    topology.build(position, radius_);
    const auto n = static_cast<int64_t>(position.size());
    return {.particles = n, .moving = n, .level = {{.cells = 0, .edges = topology.levels[0].edges}}};
  }

 private:
  void run(const std::vector<float>& features, const std::vector<int32_t>& particle_type, Workspace& workspace,
           std::vector<float>& acceleration) const {
    workspace.prepare(width_, inputs_);
    const GraphTopology& topology = workspace.topology;
    Buffer<float>& node = workspace.cell[0];
    const int32_t* order = topology.order.data();
    for_each_range(workspace, topology.levels[0].cells, tile_rows,
                   [&](int32_t begin, int32_t end, TileScratch& scratch) {
                     particles_.apply(order + begin, end - begin, features, particle_type, scratch,
                                      node.data() + static_cast<int64_t>(begin) * width_);
                   });
    edges_.apply(topology, radius_, workspace);
    steps_.apply(topology.levels[0], node, workspace);
    for_each_range(workspace, topology.levels[0].cells, tile_rows,
                   [&](int32_t begin, int32_t end, TileScratch& scratch) {
                     decoder_.apply(node.data() + static_cast<int64_t>(begin) * width_, order + begin, end - begin,
                                    scratch, acceleration);
                   });
  }

  int width_, inputs_;
  double radius_;
  ParticleEncoder particles_;
  EdgeEncoder edges_;
  MessagePassing steps_;
  ParticleDecoder decoder_;
  mutable WorkspacePool<Workspace> workspaces_;
};

}  // namespace

std::unique_ptr<CpuEngine> make_gns_engine(const LayerPlan& plan, const nn::Weights& weights, double spacing) {
  return std::make_unique<GnsEngine>(plan, weights, spacing);
}

}  // namespace graupel::graph
