// Places of a plan's weights in one flat array, so that the optimiser, the moving average and the gradient norm are
// single operations. Names and shapes are LayerPlan::tensors().
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "graph/plan/layer_plan.h"
#include "nn/weights.h"
#include "train/config/network_config.h"

namespace graupel::train {

/// `count` numbers from `begin` of the flat array, row-major.
struct Parameter : graph::PlanTensor {
  int64_t begin = 0, count = 0;
};

class ParameterLayout {
 public:
  explicit ParameterLayout(const NetworkConfig& config) : ParameterLayout(plan_of(config)) {}
  explicit ParameterLayout(graph::LayerPlan plan);

  int64_t size() const { return size_; }              ///< numbers of the flat array, gaps for alignment included
  int64_t parameter_count() const { return count_; }  ///< numbers that are weights
  const std::vector<Parameter>& parameters() const { return parameters_; }
  const graph::LayerPlan& plan() const { return plan_; }
  const Parameter& find(const std::string& name) const;

  /// PyTorch's defaults from Graupel's own generator: linear layers uniform in +-1/sqrt(fan_in), embedding N(0, 1),
  /// norms one and zero. The same seed gives the same numbers with any libtorch.
  std::vector<float> initial_values(uint64_t seed) const;

  nn::Weights to_weights(const std::vector<float>& flat) const;
  /// Throws InputError when a tensor is missing or of another shape.
  std::vector<float> from_weights(const nn::Weights& weights) const;

 private:
  graph::LayerPlan plan_;
  std::vector<Parameter> parameters_;
  int64_t size_ = 0, count_ = 0;
};

}  // namespace graupel::train
