#include <map>

#include "graph/cpu/hgn_engine.h"
#include "graph/cpu/messages/level_transfer.h"
#include "graph/cpu/messages/message_passing.h"
#include "graph/cpu/messages/particle_transfer.h"
#include "graph/cpu/workspace_pool.h"
#include "graph/plan/plan_walk.h"

namespace graupel::graph {

namespace {

class MessageEngine : public HgnEngine {
 public:
  MessageEngine(const nn::Weights& weights, const HgnConfig& config)
      : features_(static_cast<int>(config.input_width())),
        width_(nn::padded_width(static_cast<int>(config.latent))),
        plan_(plan_of(config)),
        particles_(weights, config) {
    for (const PlanBlock& block : plan_.blocks) {
      if (block.links.kind == LinkKind::cell_neighbors)
        passing_.emplace(block.number, MessagePassing(weights, config, block.name));
      if (block.links.kind == LinkKind::to_parent) between_.emplace_back(weights, config, block.level());
    }
  }

  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const sparsegrid::Hierarchy<3>& hierarchy, std::vector<float>& acceleration) const override {
    auto workspace = workspaces_.take();
    workspace->topology.build(hierarchy);
    workspace->prepare(width_, features_);
    particles_.encode(features, particle_type, hierarchy, *workspace);
    Pass pass{*this, hierarchy, *workspace, acceleration};
    run_blocks(plan_, pass);
    workspaces_.give_back(std::move(workspace));
  }

 private:
  struct Pass {
    void particle_to_grid(const PlanBlock&) { engine.particles_.particle_to_grid(hierarchy, workspace); }
    void pass_messages(const PlanBlock& block) { engine.passing_.at(block.number).apply(block.level(), workspace); }
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

  int features_, width_;
  LayerPlan plan_;
  ParticleTransfer particles_;
  std::map<std::size_t, MessagePassing> passing_;  ///< by the block's number
  std::vector<LevelTransfer> between_;             ///< by the finer level
  mutable WorkspacePool<Workspace> workspaces_;
};

}  // namespace

std::unique_ptr<HgnEngine> make_message_engine(const nn::Weights& weights, const HgnConfig& config) {
  return std::make_unique<MessageEngine>(weights, config);
}

}  // namespace graupel::graph
