// One block of M message-passing iterations on the cells of a level (HGN paper, section 3.2 and figure 5):
//   out_ij = FCN^e_k([f_i, f_j, e_ij]),  e_ij <- out_ij (k = 0) or e_ij + out_ij,  f_j <- f_j + FCN^c_k([sum_i out_ij,
//   f_j]),  with e_ij = (x_j - x_i)/spacing at the start.
#pragma once

#include <string>
#include <vector>

#include "graph/config/hgn_config.h"
#include "graph/cpu/workspace.h"
#include "nn/fcn.h"

namespace graupel::graph {

class MessagePassing {
 public:
  /// `block` is the prefix of its weights: "down.<l>" or "up.<l>".
  MessagePassing(const nn::Weights& weights, const HgnConfig& config, const std::string& block);

  /// Updates the cells of `level` in workspace.cell[level].
  void apply(std::size_t level, Workspace& workspace) const;

 private:
  struct Iteration {
    nn::StackedLinear projection;  ///< of f: sender part, receiver part, cell part
    nn::InputTable direction;      ///< first iteration: part of the edge's start value, by neighbour slot
    nn::Linear edge_part;          ///< later iterations: of the edge latent
    nn::NormalizedLayer edge_second;
    nn::Linear message_part;
    nn::NormalizedLayer cell_second;
  };
  struct Tile;

  void project(const Iteration& iteration, const Tile& tile, float* projection) const;
  void update_edges(std::size_t k, const Tile& tile) const;
  void update_cells(const Iteration& iteration, const Tile& tile) const;

  int width_;
  std::vector<Iteration> iterations_;
};

}  // namespace graupel::graph
