// Weights of a plan's layers.
#pragma once

#include "graph/plan/layer_plan.h"
#include "nn/fcn.h"

namespace graupel::graph {

/// Throws InputError for a tensor that is missing, of another shape or not finite.
inline nn::FcnWeights load(const nn::Weights& weights, const PlanLayer& layer) {
  return nn::FcnWeights::load(weights, layer.name, static_cast<int>(layer.inputs), static_cast<int>(layer.hidden),
                              static_cast<int>(layer.outputs), layer.norm ? nn::Norm::layer : nn::Norm::none,
                              static_cast<int>(layer.hidden_layers));
}

/// Padded width of a plan's latents (nn/linear.h).
inline int width_of(const LayerPlan& plan) { return nn::padded_width(static_cast<int>(plan.layers.front().outputs)); }
/// Numbers of a particle that the encoder takes.
inline int inputs_of(const LayerPlan& plan) { return static_cast<int>(plan.layers.front().inputs); }

}  // namespace graupel::graph
