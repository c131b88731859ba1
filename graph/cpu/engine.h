// Evaluation of a plan on the CPU.
#pragma once

#include <memory>
#include <vector>

#include "graph/network.h"
#include "graph/plan/layer_plan.h"
#include "nn/weights.h"

namespace graupel::graph {

class CpuEngine {
 public:
  virtual ~CpuEngine() = default;

  /// Normalised accelerations [n, outputs] of n > 0 particles of known types, from features [n, features] and positions
  /// [n]; `origin` is that of the grid. Adds to the times of the graph and of the network. May be called from several
  /// threads.
  virtual void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                        const std::vector<Vec3f>& position, const Vec3d& origin, std::vector<float>& acceleration,
                        FrameTiming& timing) const = 0;
  /// Rows of the graph of these particles.
  virtual PlanRows rows(const std::vector<Vec3f>& position, const Vec3d& origin) const = 0;
};

/// `spacing` [m] is the cell size of the finest level, or the radius of the graph. Throw InputError when a tensor is
/// missing or of another shape.
std::unique_ptr<CpuEngine> make_gns_engine(const LayerPlan& plan, const nn::Weights& weights, double spacing);
std::unique_ptr<CpuEngine> make_message_engine(const LayerPlan& plan, const nn::Weights& weights, double spacing);
std::unique_ptr<CpuEngine> make_activation_engine(const LayerPlan& plan, const nn::Weights& weights, double spacing);

}  // namespace graupel::graph
