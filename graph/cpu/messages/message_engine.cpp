#include "graph/cpu/hgn_engine.h"
#include "graph/cpu/messages/level_transfer.h"
#include "graph/cpu/messages/message_passing.h"
#include "graph/cpu/messages/particle_transfer.h"
#include "graph/cpu/workspace_pool.h"

namespace graupel::graph {

namespace {

class MessageEngine : public HgnEngine {
 public:
  MessageEngine(const nn::Weights& weights, const HgnConfig& config)
      : features_(static_cast<int>(config.input_width())),
        width_(nn::padded_width(static_cast<int>(config.latent))),
        particles_(weights, config) {
    const auto levels = static_cast<std::size_t>(config.levels);
    for (std::size_t l = 0; l < levels; ++l) down_.emplace_back(weights, config, "down." + std::to_string(l));
    for (std::size_t l = 0; l + 1 < levels; ++l) {
      up_.emplace_back(weights, config, "up." + std::to_string(l));
      between_.emplace_back(weights, config, l);
    }
  }

  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const sparsegrid::Hierarchy<3>& hierarchy, std::vector<float>& acceleration) const override {
    auto workspace = workspaces_.take();
    evaluate(features, particle_type, hierarchy, *workspace, acceleration);
    workspaces_.give_back(std::move(workspace));
  }

 private:
  /// Steps 0 to 12 of figure 2 of the paper.
  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                std::vector<float>& acceleration) const {
    workspace.topology.build(hierarchy);
    workspace.prepare(width_, features_);
    particles_.encode(features, particle_type, hierarchy, workspace);
    particles_.particle_to_grid(hierarchy, workspace);
    down_[0].apply(0, workspace);
    for (std::size_t l = 0; l < between_.size(); ++l) {
      between_[l].restrict_to_coarse(hierarchy, workspace);
      down_[l + 1].apply(l + 1, workspace);
    }
    for (std::size_t l = between_.size(); l-- > 0;) {
      between_[l].prolong_to_fine(hierarchy, workspace);
      up_[l].apply(l, workspace);
    }
    particles_.grid_to_particle(hierarchy, workspace, acceleration);
  }

  int features_, width_;
  ParticleTransfer particles_;
  std::vector<MessagePassing> down_, up_;
  std::vector<LevelTransfer> between_;
  mutable WorkspacePool<Workspace> workspaces_;
};

}  // namespace

std::unique_ptr<HgnEngine> make_message_engine(const nn::Weights& weights, const HgnConfig& config) {
  return std::make_unique<MessageEngine>(weights, config);
}

}  // namespace graupel::graph
