// Evaluation of the hierarchical graph network on the CPU, in either of its forms (graph/config/hgn_config.h,
// Aggregation).
#pragma once

#include <memory>
#include <vector>

#include "graph/config/hgn_config.h"
#include "nn/weights.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

class HgnEngine {
 public:
  virtual ~HgnEngine() = default;

  /// Normalised accelerations [n, output_width()] of n > 0 particles of known types. May be called from several
  /// threads.
  virtual void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                        const sparsegrid::Hierarchy<3>& hierarchy, std::vector<float>& acceleration) const = 0;
};

/// Sums of messages. Throws InputError when a tensor is missing or of another shape, as the next.
std::unique_ptr<HgnEngine> make_message_engine(const nn::Weights& weights, const HgnConfig& config);
/// Sums of activations.
std::unique_ptr<HgnEngine> make_activation_engine(const nn::Weights& weights, const HgnConfig& config);

}  // namespace graupel::graph
