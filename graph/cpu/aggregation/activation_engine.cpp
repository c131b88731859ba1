#include <map>

#include "graph/cpu/aggregation/cell_aggregation.h"
#include "graph/cpu/aggregation/particle_aggregation.h"
#include "graph/cpu/grid_engine.h"
#include "graph/cpu/layer_weights.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

/// Each step also projects its results for the step that gathers them (epilogue projection): W_s f_s and W_r f_r.
class ActivationEngine : public GridEngine<AggregationWorkspace> {
 public:
  ActivationEngine(const LayerPlan& plan, const nn::Weights& weights, double spacing)
      : GridEngine(plan, spacing), particles_(weights, plan) {
    for (const PlanBlock& block : plan.blocks) {
      if (block.links.kind == LinkKind::cell_neighbors)
        for (std::size_t k = 0; k < static_cast<std::size_t>(block.iterations); ++k)
          iterations_[block.number].emplace_back(weights, plan, block, k);
      if (block.links.kind == LinkKind::to_parent) restrict_.emplace_back(weights, plan, block);
      if (block.links.kind == LinkKind::from_parent) prolong_.emplace(block.level(), Prolong(weights, plan, block));
    }
  }

 private:
  void run(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
           const sparsegrid::Hierarchy<3>& hierarchy, AggregationWorkspace& workspace,
           std::vector<float>& acceleration) const override {
    workspace.topology.build_order(hierarchy);
    workspace.prepare(hierarchy, static_cast<int>(plan().layers.front().outputs), inputs_of(plan()));
    particles_.encode(features, particle_type, hierarchy, workspace);
    Pass pass{*this, hierarchy, workspace, acceleration};
    run_blocks(plan(), pass);
  }

  struct Pass {
    void particle_to_grid(const PlanBlock& block) {
      engine.particles_.particle_to_grid(hierarchy, engine.gathered_after(block), workspace);
    }
    void pass_messages(const PlanBlock& block) {
      const std::vector<CellAggregation>& iterations = engine.iterations_.at(block.number);
      for (std::size_t k = 0; k < iterations.size(); ++k)
        iterations[k].apply(hierarchy, block.level(),
                            k + 1 < iterations.size() ? iterations[k + 1].gathered() : engine.gathered_after(block),
                            workspace);
    }
    void restrict_to_coarse(const PlanBlock& block) {
      engine.restrict_[block.level()].apply(hierarchy, engine.gathered_after(block), workspace);
    }
    void prolong_to_fine(const PlanBlock& block) {
      engine.prolong_.at(block.level()).apply(hierarchy, engine.gathered_after(block), workspace);
    }
    void grid_to_particle(const PlanBlock&) { engine.particles_.grid_to_particle(hierarchy, workspace, acceleration); }

    const ActivationEngine& engine;
    const sparsegrid::Hierarchy<3>& hierarchy;
    AggregationWorkspace& workspace;
    std::vector<float>& acceleration;
  };

  /// First layer of the block behind `block`.
  const nn::Linear& gathered_after(const PlanBlock& block) const {
    const PlanBlock& next_block = plan().blocks[block.number + 1];
    switch (next_block.links.kind) {
      case LinkKind::cell_neighbors:
        return iterations_.at(next_block.number).front().gathered();
      case LinkKind::to_parent:
        return restrict_[next_block.level()].gathered();
      case LinkKind::from_parent:
        return prolong_.at(next_block.level()).gathered();
      default:
        return particles_.gathered();
    }
  }

  ParticleAggregation particles_;
  std::map<std::size_t, std::vector<CellAggregation>> iterations_;  ///< by the block's number
  std::vector<RestrictAggregation> restrict_;                       ///< by the finer level
  std::map<std::size_t, Prolong> prolong_;                          ///< by the finer level
};

}  // namespace

std::unique_ptr<CpuEngine> make_activation_engine(const LayerPlan& plan, const nn::Weights& weights, double spacing) {
  return std::make_unique<ActivationEngine>(plan, weights, spacing);
}

}  // namespace graupel::graph
