// A block of M message-passing iterations on the cells of a level (HGN paper, section 3.2 and figure 5) or on the
// particles of GNS (Sanchez-Gonzalez et al. 2020, section 3.2), an interaction network each (Battaglia et al. 2016):
//   out_ij = FCN^e_k([f_i, f_j, e_ij]),  f_j <- f_j + FCN^n_k([sum_i out_ij, f_j]),  e_ij <- e_ij + out_ij.
// In GNS e_ij starts from the edge encoder's latents. Between cells e_ij = (x_j - x_i)/spacing for k = 0, and out_ij
// after.
#pragma once

#include <vector>

#include "graph/cpu/workspace.h"
#include "graph/plan/layer_plan.h"
#include "nn/fcn.h"

namespace graupel::graph {

class MessagePassing {
 public:
  MessagePassing(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block);

  /// Updates the rows of `node`, and those of workspace.edge but for the last iteration.
  void apply(const HostLinks& links, Buffer<float>& node, Workspace& workspace) const;

 private:
  struct Iteration {
    nn::StackedLinear projection;  ///< of f: sender part, receiver part, node part
    nn::InputTable direction;      ///< where the edge starts from its offset: part of it, by neighbour slot
    nn::Linear edge_part;          ///< elsewhere: of the edge latent
    nn::Linear message_part;
    nn::MiddleLayers edge_middle, node_middle;
    nn::NormalizedLayer edge_last, node_last;
  };
  struct Tile;

  bool starts_from_offsets(std::size_t k) const { return k == 0 && offsets_; }
  void project(const Iteration& iteration, const Tile& tile, float* projection) const;
  void update_edges(std::size_t k, const Tile& tile) const;
  void update_nodes(const Iteration& iteration, const Tile& tile) const;

  int width_;
  float slope_;
  bool offsets_;  ///< of the links
  std::vector<Iteration> iterations_;
};

}  // namespace graupel::graph
