// The edge encoder and the M message-passing steps of GNS (Sanchez-Gonzalez et al. 2020, section 3.2 and appendix A),
// an interaction network each (Battaglia et al. 2016):
//   out_ij = FCN^e_k([f_i, f_j, e_ij]),  f_j <- f_j + FCN^n_k([sum_i out_ij, f_j]),  e_ij <- e_ij + out_ij.
#pragma once

#include <vector>

#include "graph/config/gns_config.h"
#include "graph/topology/gns_graph.h"
#include "graph/topology/tiles.h"
#include "nn/fcn.h"

namespace graupel::graph {

/// Memory of one evaluation, kept between frames. Edges have the only arrays that grow with their number: one latent
/// and two indices each; everything else of an edge lives in a thread's scratch.
struct GnsWorkspace {
  GnsGraph graph;
  Buffer<float> node;                ///< [n][H] latents, in sorted order
  Buffer<float> edge;                ///< [edges][H] latents
  Buffer<float> projection[2];       ///< [n][3 H] sender, receiver and node parts, of this and the next step
  std::vector<TileScratch> scratch;  ///< per thread

  /// Sizes everything for the graph, `width` = H and the number of features.
  void prepare(int width, int features);
};

class GnsProcessor {
 public:
  GnsProcessor(const nn::Weights& weights, const GnsConfig& config);

  /// Updates workspace.node, the latents of the node encoder.
  void apply(GnsWorkspace& workspace) const;

 private:
  struct Step {
    nn::StackedLinear projection;  ///< of f: sender part, receiver part, node part
    nn::Linear edge_part, message_part;
    nn::MiddleLayers edge_middle, node_middle;
    nn::NormalizedLayer edge_last, node_last;
  };
  struct Tile;

  void encode_edges(GnsWorkspace& workspace) const;
  void project(const Step& step, const Tile& tile, float* projection) const;
  void update_edges(std::size_t k, const Tile& tile) const;
  void update_nodes(const Step& step, const Tile& tile) const;

  int width_;
  float slope_;
  double radius_;
  nn::Linear encoder_first_;
  nn::MiddleLayers encoder_middle_;
  nn::NormalizedLayer encoder_last_;
  std::vector<Step> steps_;
};

}  // namespace graupel::graph
