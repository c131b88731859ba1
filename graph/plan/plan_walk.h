// The order of an HGN's blocks, for engines whose kernels run a block at a time: down the levels of the grid hierarchy
// and up again (HGN paper, figure 2). The only place that goes over them; the order itself is the plan's.
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

}  // namespace graupel::graph
