// The order of an HGN's blocks, for engines whose kernels run a block at a time: down the levels of the grid hierarchy
// and up again (HGN paper, figure 2). The only place that goes over them; the order itself is the plan's. And the
// layers of a block, by which the kernels find its weights.
#pragma once

#include "core/system/error.h"
#include "graph/plan/layer_plan.h"

namespace graupel::graph {

/// Calls the member function of `engine` that runs `block`.
template <typename Engine>
void visit_block(const LayerPlan& plan, const PlanBlock& block, Engine& engine) {
  switch (block.links.kind) {
    case LinkKind::particle_to_cell:
      return engine.particle_to_grid(block);
    case LinkKind::cell_neighbors:
      return engine.pass_messages(block);
    case LinkKind::to_parent:
      return engine.restrict_to_coarse(block);
    case LinkKind::from_parent:
      return engine.prolong_to_fine(block);
    case LinkKind::cell_to_particle:
      return engine.grid_to_particle(block);
    case LinkKind::particle_neighbors:
      break;
  }
  throw ConfigError("plan '" + plan.name + "', block '" + block.name +
                    "': engines of grid hierarchies have no kernels for links between particles");
}

/// A forward pass, from the particles' latents to those before the decoder.
template <typename Engine>
void run_blocks(const LayerPlan& plan, Engine& engine) {
  for (const PlanBlock& block : plan.blocks) visit_block(plan, block, engine);
}

/// A backward pass.
template <typename Engine>
void run_blocks_in_reverse(const LayerPlan& plan, Engine& engine) {
  for (std::size_t b = plan.blocks.size(); b-- > 0;) visit_block(plan, plan.blocks[b], engine);
}

/// Layers of one iteration of a block: of its gather, and of the update of what the receivers gather, if there is one.
struct BlockLayers {
  const PlanLayer *gather = nullptr, *update = nullptr;
};
inline BlockLayers layers_of(const LayerPlan& plan, const PlanBlock& block, int64_t iteration = 0) {
  BlockLayers found;
  for (std::size_t i = block.operation; i < plan.operations.size(); ++i) {
    const PlanOperation& op = plan.operations[i];
    const bool is_gather = op.kind == operation::gather, is_update = op.kind == operation::update;
    if (found.gather != nullptr && (is_gather || is_update)) {
      if (is_update) found.update = &plan.layers[static_cast<std::size_t>(op.layer)];
      break;
    }
    if (is_gather && iteration-- == 0) found.gather = &plan.layers[static_cast<std::size_t>(op.layer)];
  }
  GRAUPEL_ASSERT(found.gather != nullptr);
  return found;
}

}  // namespace graupel::graph
