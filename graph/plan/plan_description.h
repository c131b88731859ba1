// A plan as text: the table of its operations and tensors in docs/reference/network_plans.md.
#pragma once

#include <string>

#include "graph/plan/layer_plan.h"

namespace graupel::graph {

/// Markdown table, a row an operation in the order in which they run: what it makes, of which rows and how wide; its
/// inputs in the order of the layer's columns; its tensors and their shapes.
std::string description_of(const LayerPlan& plan);

}  // namespace graupel::graph
