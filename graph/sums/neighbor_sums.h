// What particles gather from each other before the grid does (HgnConfig::short_range), over all links (i, j) within the
// radius r, those of a particle to itself included, a(x) = leaky_relu(x):
//   f_j <- f_j + FCN([p2g_scale sum over i of a(W [f_i, f_j, (x_i - x_j)/r, |x_i - x_j|/r] + b), f_j])
#pragma once

#include <vector>

#include "graph/hgn_config.h"
#include "graph/sums/receiver_network.h"
#include "graph/sums/sum_workspace.h"

namespace graupel::graph {

class NeighborSums {
 public:
  NeighborSums(const nn::Weights& weights, const HgnConfig& config);

  /// Links between the particles, in the order of the topology.
  void link(const std::vector<Vec3f>& position, SumWorkspace& workspace) const;
  /// Where what is gathered of the latents from `begin` on goes.
  NextRows rows(int32_t begin, SumWorkspace& workspace) const;
  /// Of the particles [begin, end), whose rows are all there; ends with the next rows.
  void apply(int32_t begin, int32_t end, const NextRows& next, SumWorkspace& workspace, TileScratch& scratch) const;

 private:
  /// Word as in GatheredRows. Overwrites scratch.output.
  template <typename Word>
  void gather(int32_t receiver, const SumWorkspace& workspace, TileScratch& scratch, float* sum) const;
  /// W_e of the link from a sender, into a row.
  void link_part(const Vec3f& sender, const Vec3f& receiver, float* part) const;

  int width_;
  float scale_;
  double radius_;
  nn::StackedLinear gathered_;  ///< [2 H]: sender part, receiver part
  nn::InputTable link_;         ///< per number of a link, the part of a unit
  ReceiverNetwork network_;
};

}  // namespace graupel::graph
