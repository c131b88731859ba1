// What the forward passes of graph networks on a GPU have in common: the encoder, the projections of nodes for the
// first layers of the gathers that read them, updates, prolongation. Their forms differ in what receivers sum.
#pragma once

#include <string>
#include <vector>

#include "graph/cuda/forward/packed_network.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

class ForwardPass {
 protected:
  static constexpr int corners = 8;
  static constexpr int64_t h = layer_width;
  /// Pair q belongs to particle q / 8 and corner q % 8.
  static constexpr RowOf by_particle{nullptr, 3, -1}, by_corner{nullptr, 0, corners - 1};
  static constexpr RowOf always_first{nullptr, 0, 0};

  ForwardPass(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory, void* stream);

  RowLatents latents(int64_t rows) { return {memory_.rows32(rows), memory_.rows16(rows)}; }
  BlockLayers layers(const PlanBlock& block, int64_t iteration = 0) const {
    return layers_of(network_.plan(), block, iteration);
  }
  /// Latents of the particles after the encoder; launches it. Without a count of rows all particles are there.
  void encode_particles(FusedMlp& encoder, const int32_t* row_count = nullptr);

  /// Of a gather over [f_s, f_r, ..]: W_s f, and W_r f with the bias, of `rows` nodes; in bf16 for a linear layer.
  Projections node_projections(const PlanLayer& gather, int64_t rows);
  /// The same of another layer, in the place of `taken`.
  Projections node_projections(const PlanLayer& gather, const Projections& taken) const;
  void project_nodes(const Projections& wanted, const LevelLinks& level, const uint16_t* nodes);
  /// The particles' parts of the first layers of both transfers, made at once: to the grid W_f f_p + b - W_o offset_p,
  /// from it W_p f_p + b + W_o offset_p.
  Projections project_particles();

  /// FCN `layer` over [sum] or, with `nodes`, over [sum, nodes]; the nodes are added to its result.
  FusedMlp update(const PlanLayer& layer, int64_t rows, const int32_t* row_count, RowOperand sum,
                  const RowLatents& nodes, const RowLatents& result) const;
  /// The block of a prolongation, with the projections for the iteration that follows it where that is possible.
  FusedMlp prolong(const PlanBlock& block);

  const PackedNetwork& network_;
  const NetworkGraph& graph_;
  RowMemory& memory_;
  void* stream_;
  std::vector<RowLatents> f_;  ///< cells of each level
  RowLatents particles_;       ///< after the encoder
  Projections ahead_;          ///< for the next block's first iteration, where they are there already

 private:
  /// Where two projections of rows go.
  Projections rows_for(const PlanLayer& gather, int64_t rows, const PlanLayer& other);
};

}  // namespace graupel::graph
