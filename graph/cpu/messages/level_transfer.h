// Transfers between a level and the next coarser one (HGN paper, section 3.2, steps 3, 5 and 7, 9):
//   restrict  f_coarse = sum over children FCN([f_fine, (centre_coarse - centre_fine)/spacing_fine])
//   prolong   f_fine += FCN([f_coarse, f_fine, (centre_fine - centre_coarse)/spacing_fine])
#pragma once

#include "graph/cpu/workspace.h"
#include "graph/plan/layer_plan.h"
#include "nn/fcn.h"

namespace graupel::graph {

class LevelTransfer {
 public:
  /// Between `level` and `level` + 1.
  LevelTransfer(const nn::Weights& weights, const LayerPlan& plan, int level);

  void restrict_to_coarse(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const;
  void prolong_to_fine(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const;

 private:
  std::size_t level_;
  int width_;
  nn::Linear restrict_first_, prolong_coarse_part_, prolong_fine_part_;
  nn::InputTable restrict_octant_, prolong_octant_;  ///< by child slot
  nn::NormalizedLayer restrict_second_, prolong_second_;
};

}  // namespace graupel::graph
