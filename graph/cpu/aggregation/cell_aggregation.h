// Message passing and transfers between levels of a network that sums activations
// (docs/decisions/0011-sums-of-activations.md), a(x) = leaky_relu(x):
//   iteration  f_j <- f_j + FCN([sum over edges of a(W [f_i, f_j, e_ij] + b), f_j]),  e_ij = (x_j - x_i)/spacing
//   restrict   f_coarse = FCN(sum over children of a(W [f_fine, (centre_coarse - centre_fine)/spacing_fine] + b))
//   prolong    f_fine <- f_fine + FCN([f_coarse, f_fine, (centre_fine - centre_coarse)/spacing_fine])
// Products with W are made once a cell, where the cell was updated, for the step that gathers them: each step ends with
// what the `next` one wants.
#pragma once

#include "graph/cpu/aggregation/aggregation_workspace.h"
#include "graph/cpu/aggregation/receiver_network.h"
#include "graph/plan/layer_plan.h"

namespace graupel::graph {

/// One iteration of a block.
class CellAggregation {
 public:
  /// Iteration k.
  CellAggregation(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block, std::size_t k);

  /// What it gathers, [2 H]: sender part, receiver part.
  const nn::Linear& gathered() const { return gathered_.linear(); }
  void apply(const sparsegrid::Hierarchy<3>& hierarchy, std::size_t level, const nn::Linear& next_layer,
             AggregationWorkspace& workspace) const;

 private:
  /// Word as in GatheredRows; `rows` are the cells' sender and receiver parts.
  template <typename Word>
  void gather(const std::array<int32_t, 6>& neighbor, const Word* receiver, const Word* rows, float* sum) const;

  int width_;
  nn::StackedLinear gathered_;
  nn::InputTable direction_;  ///< by neighbour slot
  ReceiverNetwork network_;
};

/// From a level to the next coarser one.
class RestrictAggregation {
 public:
  RestrictAggregation(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block);

  /// What it gathers of fine cells, [H].
  const nn::Linear& gathered() const { return gathered_; }
  void apply(const sparsegrid::Hierarchy<3>& hierarchy, const nn::Linear& next_layer,
             AggregationWorkspace& workspace) const;

 private:
  std::size_t level_;
  int width_;
  nn::Linear gathered_;
  nn::InputTable octant_;
  ReceiverNetwork network_;
};

/// From a level to the next finer one.
class Prolong {
 public:
  Prolong(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block);

  /// What it gathers of coarse cells, [H].
  const nn::Linear& gathered() const { return gathered_; }
  void apply(const sparsegrid::Hierarchy<3>& hierarchy, const nn::Linear& next_layer,
             AggregationWorkspace& workspace) const;

 private:
  std::size_t level_;
  int width_;
  nn::Linear gathered_, fine_part_;
  nn::InputTable octant_;
  nn::NormalizedLayer second_;
};

}  // namespace graupel::graph
