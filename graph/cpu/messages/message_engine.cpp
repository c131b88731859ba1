#include <map>

#include "graph/cpu/grid_engine.h"
#include "graph/cpu/layer_weights.h"
#include "graph/cpu/messages/level_transfer.h"
#include "graph/cpu/messages/message_passing.h"
#include "graph/cpu/messages/particle_transfer.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

class MessageEngine : public GridEngine<Workspace> {
 public:
  MessageEngine(const LayerPlan& plan, const nn::Weights& weights, double spacing)
      : GridEngine(plan, spacing), particles_(weights, plan) {
    for (const PlanBlock& block : plan.blocks) {
      if (block.links.kind == LinkKind::cell_neighbors)
        passing_.emplace(block.number, MessagePassing(weights, plan, block));
      if (block.links.kind == LinkKind::to_parent) between_.emplace_back(weights, plan, block.links.level);
    }
  }

 private:
  void run(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
           const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
           std::vector<float>& acceleration) const override {
    workspace.topology.build(hierarchy);
    workspace.prepare(width_of(plan()), inputs_of(plan()));
    particles_.encode(features, particle_type, hierarchy, workspace);
    Pass pass{*this, hierarchy, workspace, acceleration};
    run_blocks(plan(), pass);
  }

  struct Pass {
    void particle_to_grid(const PlanBlock&) { engine.particles_.particle_to_grid(hierarchy, workspace); }
    void pass_messages(const PlanBlock& block) {
      const std::size_t level = block.level();
      engine.passing_.at(block.number).apply(workspace.topology.levels[level], workspace.cell[level], workspace);
    }
    void restrict_to_coarse(const PlanBlock& block) {
      engine.between_[block.level()].restrict_to_coarse(hierarchy, workspace);
    }
    void prolong_to_fine(const PlanBlock& block) {
      engine.between_[block.level()].prolong_to_fine(hierarchy, workspace);
    }
    void grid_to_particle(const PlanBlock&) { engine.particles_.grid_to_particle(hierarchy, workspace, acceleration); }

    const MessageEngine& engine;
    const sparsegrid::Hierarchy<3>& hierarchy;
    Workspace& workspace;
    std::vector<float>& acceleration;
  };

  ParticleTransfer particles_;
  std::map<std::size_t, MessagePassing> passing_;  ///< by the block's number
  std::vector<LevelTransfer> between_;             ///< by the finer level
};

}  // namespace

std::unique_ptr<CpuEngine> make_message_engine(const LayerPlan& plan, const nn::Weights& weights, double spacing) {
  return std::make_unique<MessageEngine>(plan, weights, spacing);
}

}  // namespace graupel::graph
