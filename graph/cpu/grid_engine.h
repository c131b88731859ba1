// What the engines of both forms of the hierarchical graph network (graph/config/hgn_config.h, Aggregation) share: the
// grid hierarchy of each frame, and memory for several threads.
#pragma once

#include "graph/cpu/engine.h"
#include "graph/cpu/lap_timer.h"
#include "graph/cpu/workspace_pool.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

template <typename Workspace>
class GridEngine : public CpuEngine {
 public:
  GridEngine(const LayerPlan& plan, double spacing) : plan_(plan), spacing_(spacing) {}

  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const std::vector<Vec3f>& position, const Vec3d& origin, std::vector<float>& acceleration,
                FrameTiming& timing) const final {
    LapTimer watch;
    const sparsegrid::Hierarchy<3> hierarchy = grid(position, origin);
    timing.hierarchy += watch.lap();
    auto workspace = workspaces_.take();
    run(features, particle_type, hierarchy, *workspace, acceleration);
    workspaces_.give_back(std::move(workspace));
    timing.network += watch.lap();
  }
  PlanRows rows(const std::vector<Vec3f>& position, const Vec3d& origin) const final {
    return rows_of(grid(position, origin));
  }

 protected:
  const LayerPlan& plan() const { return plan_; }

 private:
  virtual void run(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                   const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                   std::vector<float>& acceleration) const = 0;
  sparsegrid::Hierarchy<3> grid(const std::vector<Vec3f>& position, const Vec3d& origin) const {
    return sparsegrid::build_hierarchy<3>(position, spacing_, origin, plan_.levels());
  }

  LayerPlan plan_;
  double spacing_;
  mutable WorkspacePool<Workspace> workspaces_;
};

}  // namespace graupel::graph
