#include "graph/plan/layer_plan.h"

#include <algorithm>

#include "core/system/error.h"
#include "graph/features/features.h"

namespace graupel::graph {

Rows Links::sender() const {
  switch (kind) {
    case LinkKind::particle_to_cell:
    case LinkKind::particle_neighbors:
      return {RowSet::particles, 0};
    case LinkKind::cell_to_particle:
      return {RowSet::cells, 0};
    case LinkKind::cell_neighbors:
    case LinkKind::to_parent:
      return {RowSet::cells, level};
    case LinkKind::from_parent:
      return {RowSet::cells, level + 1};
  }
  return {};
}

Rows Links::receiver() const {
  switch (kind) {
    case LinkKind::particle_to_cell:
      return {RowSet::cells, 0};
    case LinkKind::cell_to_particle:
    case LinkKind::particle_neighbors:
      return {RowSet::particles, 0};
    case LinkKind::cell_neighbors:
    case LinkKind::from_parent:
      return {RowSet::cells, level};
    case LinkKind::to_parent:
      return {RowSet::cells, level + 1};
  }
  return {};
}

Rows Links::rows() const {
  switch (kind) {
    case LinkKind::particle_to_cell:
    case LinkKind::cell_to_particle:
      return {RowSet::pairs, 0};
    case LinkKind::cell_neighbors:
    case LinkKind::particle_neighbors:
      return {RowSet::edges, level};
    case LinkKind::to_parent:
    case LinkKind::from_parent:
      return {RowSet::cells, level};
  }
  return {};
}

int64_t Links::offset() const { return kind == LinkKind::particle_neighbors ? 0 : 3; }

int64_t PlanLayer::products_behind_first() const {
  return is_linear() ? 0 : (hidden_layers - 1) * hidden * hidden + hidden * outputs;
}

int64_t PlanRows::count(const Rows& rows) const {
  const auto at = [&]() -> const Level& { return level.at(static_cast<std::size_t>(rows.level)); };
  switch (rows.set) {
    case RowSet::particles:
      return particles;
    case RowSet::moving:
      return moving;
    case RowSet::cells:
      return at().cells;
    case RowSet::pairs:
      return 8 * particles;
    case RowSet::edges:
      return at().edges;
  }
  return 0;
}

std::string text_of(const Rows& rows, const std::string& level) {
  switch (rows.set) {
    case RowSet::particles:
      return "particles";
    case RowSet::moving:
      return "moving particles";
    case RowSet::cells:
      return "cells" + level + std::to_string(rows.level);
    case RowSet::pairs:
      return "pairs";
    case RowSet::edges:
      return "edges" + level + std::to_string(rows.level);
  }
  return {};
}

std::vector<PlanTensor> LayerPlan::tensors() const {
  std::vector<PlanTensor> tensors = {{"embedding.weight", {embedding_rows, embedding}, 0}};
  const auto add_matrix = [&](const std::string& matrix, int64_t to, int64_t from) {
    tensors.push_back({matrix + ".weight", {to, from}, from});
    tensors.push_back({matrix + ".bias", {to}, from});
  };
  for (const PlanLayer& layer : layers) {
    if (layer.is_linear()) {
      add_matrix(layer.name, layer.outputs, layer.inputs);
      continue;
    }
    for (int64_t l = 0; l <= layer.hidden_layers; ++l)
      add_matrix(layer.name + ".layer" + std::to_string(l + 1), l < layer.hidden_layers ? layer.hidden : layer.outputs,
                 l == 0 ? layer.inputs : layer.hidden);
    if (!layer.norm) continue;
    tensors.push_back({layer.name + ".norm.weight", {layer.outputs}, 0});
    tensors.push_back({layer.name + ".norm.bias", {layer.outputs}, 0});
  }
  return tensors;
}

const PlanBlock& LayerPlan::block_of(const Links& links) const {
  const auto found =
      std::find_if(blocks.begin(), blocks.end(), [&](const auto& block) { return block.links == links; });
  if (found == blocks.end()) throw ConfigError("plan '" + name + "' has no block over the links wanted");
  return *found;
}

std::vector<PlanLayer> LayerPlan::layers_of(const PlanBlock& block) const {
  const std::size_t end = block.number + 1 < blocks.size() ? blocks[block.number + 1].operation : operations.size();
  std::vector<PlanLayer> found;
  for (std::size_t o = block.operation; o < end; ++o)
    if (operations[o].layer >= 0) found.push_back(layers[static_cast<std::size_t>(operations[o].layer)]);
  return found;
}

double LayerPlan::scale_of(const PlanBlock& block) const {
  std::size_t o = block.operation;
  while (operations.at(o).kind != operation::aggregate) ++o;
  return operations[o].scale;
}

int LayerPlan::levels() const {
  int levels = 0;
  for (const PlanBlock& block : blocks)
    if (block.links.kind == LinkKind::cell_neighbors) levels = std::max(levels, block.links.level + 1);
  return levels;
}

PlanRows rows_of(const sparsegrid::Hierarchy<3>& hierarchy) {
  PlanRows rows;
  rows.particles = rows.moving = static_cast<int64_t>(hierarchy.cell.size());
  for (const auto& level : hierarchy.levels) {
    PlanRows::Level& count = rows.level.emplace_back();
    count.cells = static_cast<int64_t>(level.size());
    for (const auto& neighbors : level.neighbor)
      for (const int32_t cell : neighbors) count.edges += cell >= 0;
  }
  return rows;
}

double flop_of(const LayerPlan& plan, const PlanRows& rows, FirstLayers first_layers) {
  double products = 0;
  const auto count = [&](int value) {
    return static_cast<double>(rows.count(plan.values[static_cast<std::size_t>(value)].rows));
  };
  for (const PlanOperation& op : plan.operations) {
    if (op.layer < 0) continue;
    const PlanLayer& layer = plan.layers[static_cast<std::size_t>(op.layer)];
    const double out_rows = count(op.output);
    products += out_rows * static_cast<double>(layer.products_behind_first());
    double first = 0;
    if (first_layers == FirstLayers::whole) {
      first = out_rows * static_cast<double>(layer.inputs);
    } else {
      for (const PlanSource& source : op.sources)
        first += (op.kind == operation::decode ? out_rows : count(source.value)) *
                 static_cast<double>(plan.values[static_cast<std::size_t>(source.value)].width);
    }
    products += first * static_cast<double>(layer.first_width());
  }
  return 2 * products;
}

}  // namespace graupel::graph
