#include "graph/cpu/aggregation/cell_aggregation.h"
#include "graph/cpu/aggregation/particle_aggregation.h"
#include "graph/cpu/hgn_engine.h"
#include "graph/cpu/workspace_pool.h"

namespace graupel::graph {

namespace {

class ActivationEngine : public HgnEngine {
 public:
  ActivationEngine(const nn::Weights& weights, const HgnConfig& config)
      : features_(static_cast<int>(config.input_width())),
        latent_(static_cast<int>(config.latent)),
        particles_(weights, config) {
    const auto levels = static_cast<std::size_t>(config.levels);
    const auto block = [&](const std::string& name) {
      Block iterations;
      for (int64_t k = 0; k < config.message_passing; ++k)
        iterations.emplace_back(weights, config, name + "." + std::to_string(k));
      return iterations;
    };
    for (std::size_t l = 0; l < levels; ++l) down_.push_back(block("down." + std::to_string(l)));
    for (std::size_t l = 0; l + 1 < levels; ++l) {
      up_.push_back(block("up." + std::to_string(l)));
      restrict_.emplace_back(weights, config, l);
      prolong_.emplace_back(weights, config, l);
    }
  }

  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const sparsegrid::Hierarchy<3>& hierarchy, std::vector<float>& acceleration) const override {
    auto workspace = workspaces_.take();
    evaluate(features, particle_type, hierarchy, *workspace, acceleration);
    workspaces_.give_back(std::move(workspace));
  }

 private:
  using Block = std::vector<CellSums>;

  /// Steps 0 to 12 of figure 2 of the HGN paper. Each step also computes the first linear layer of the next
  /// one, while its rows are in the cache.
  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const sparsegrid::Hierarchy<3>& hierarchy, SumWorkspace& workspace,
                std::vector<float>& acceleration) const {
    workspace.topology.build(hierarchy);
    workspace.prepare(hierarchy, latent_, features_);
    particles_.encode(features, particle_type, hierarchy, workspace);
    particles_.particle_to_grid(hierarchy, down_[0][0].gathered(), workspace);
    for (std::size_t l = 0; l < restrict_.size(); ++l) {
      pass(down_[l], hierarchy, l, restrict_[l].gathered(), workspace);
      restrict_[l].apply(hierarchy, down_[l + 1][0].gathered(), workspace);
    }
    pass(down_.back(), hierarchy, down_.size() - 1, after(down_.size() - 1), workspace);
    for (std::size_t l = prolong_.size(); l-- > 0;) {
      prolong_[l].apply(hierarchy, up_[l][0].gathered(), workspace);
      pass(up_[l], hierarchy, l, after(l), workspace);
    }
    particles_.grid_to_particle(hierarchy, workspace, acceleration);
  }

  /// What is gathered of a level on the way up.
  const nn::Linear& after(std::size_t level) const {
    return level > 0 ? prolong_[level - 1].gathered() : particles_.gathered();
  }

  static void pass(const Block& block, const sparsegrid::Hierarchy<3>& hierarchy, std::size_t level,
                   const nn::Linear& next, SumWorkspace& workspace) {
    for (std::size_t k = 0; k < block.size(); ++k)
      block[k].apply(hierarchy, level, k + 1 < block.size() ? block[k + 1].gathered() : next, workspace);
  }

  int features_, latent_;
  ParticleSums particles_;
  std::vector<Block> down_, up_;
  std::vector<RestrictSums> restrict_;
  std::vector<Prolong> prolong_;
  mutable WorkspacePool<SumWorkspace> workspaces_;
};

}  // namespace

std::unique_ptr<HgnEngine> make_activation_engine(const nn::Weights& weights, const HgnConfig& config) {
  return std::make_unique<ActivationEngine>(weights, config);
}

}  // namespace graupel::graph
