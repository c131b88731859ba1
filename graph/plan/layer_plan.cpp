#include "graph/plan/layer_plan.h"

#include <algorithm>
#include <set>

#include "core/system/error.h"
#include "graph/features/features.h"
#include "graph/topology/gns_graph.h"

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

namespace {

/// What an operation reads and writes, held against the plan.
class Checker {
 public:
  explicit Checker(const LayerPlan& plan) : plan_(plan) {}

  void check() {
    for (number_ = 0; number_ < plan_.operations.size(); ++number_) check(plan_.operations[number_]);
    if (used_.size() != plan_.layers.size()) fail("some layer is used by no operation");
    if (!plan_.blocks.empty()) check_blocks();
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    std::string place = "plan '" + plan_.name + "'";
    if (number_ < plan_.operations.size()) {
      const PlanOperation& op = plan_.operations[number_];
      place += ", operation " + std::to_string(number_) + " (" + op.kind;
      if (op.layer >= 0 && op.layer < static_cast<int>(plan_.layers.size()))
        place += " '" + plan_.layers[static_cast<std::size_t>(op.layer)].name + "'";
      place += ")";
    }
    throw ConfigError(place + ": " + what);
  }

  const PlanValue& value(int index) const {
    if (index < 0 || index >= plan_.inputs + static_cast<int>(number_))
      fail("value " + std::to_string(index) + " is not there yet (allowed: 0 to " +
           std::to_string(plan_.inputs + static_cast<int>(number_) - 1) + ")");
    return plan_.values.at(static_cast<std::size_t>(index));
  }
  void expect_rows(const Rows& found, const Rows& wanted) const {
    if (!(found == wanted)) fail("a source has rows of " + text_of(found) + ", wanted " + text_of(wanted));
  }

  void check(const PlanOperation& op) {
    const int next = plan_.inputs + static_cast<int>(number_);
    if (op.output != next)
      fail("writes value " + std::to_string(op.output) + ", not the next, " + std::to_string(next));
    if (plan_.values.size() <= static_cast<std::size_t>(op.output)) fail("its value is not declared");
    const PlanValue& out = plan_.values[static_cast<std::size_t>(op.output)];
    int64_t inputs = op.kind == operation::encode ? plan_.embedding : 0;
    for (const PlanSource& source : op.sources) {
      const PlanValue& in = value(source.value);
      inputs += in.width;
      if (op.kind == operation::gather)
        expect_rows(in.rows, source.end == End::sender     ? op.links.sender()
                             : source.end == End::receiver ? op.links.receiver()
                                                           : op.links.rows());
      else if (op.kind == operation::aggregate)
        expect_rows(in.rows, op.links.rows());
      else if (op.kind == operation::decode)
        expect_rows(in.rows, {RowSet::particles, 0});
      else if (op.kind == operation::encode || op.kind == operation::update || op.kind == operation::add)
        expect_rows(in.rows, out.rows);
    }
    if (op.offset) inputs += op.links.offset();
    if (op.residual >= 0) {
      const PlanValue& residual = value(op.residual);
      expect_rows(residual.rows, out.rows);
      if (residual.width != out.width) fail("adds a value of another width");
    }
    if (op.layer >= 0) check_layer(op, inputs, out.width);
  }

  void check_layer(const PlanOperation& op, int64_t inputs, int64_t outputs) {
    if (op.layer >= static_cast<int>(plan_.layers.size()))
      fail("layer " + std::to_string(op.layer) + " is not there (allowed: 0 to " +
           std::to_string(plan_.layers.size() - 1) + ")");
    const PlanLayer& layer = plan_.layers[static_cast<std::size_t>(op.layer)];
    if (!used_.insert(op.layer).second) fail("the layer is used twice");
    if (layer.inputs != inputs)
      fail("the layer takes " + std::to_string(layer.inputs) + " numbers a row, its sources give " +
           std::to_string(inputs));
    if (layer.outputs != outputs)
      fail("the layer gives " + std::to_string(layer.outputs) + " numbers a row, its value has " +
           std::to_string(outputs));
  }

  void check_blocks() {
    std::size_t block = 0;
    int64_t gathers = 0;
    for (number_ = 0; number_ < plan_.operations.size(); ++number_) {
      const PlanOperation& op = plan_.operations[number_];
      if (op.kind != operation::gather) continue;
      if (block < plan_.blocks.size() && gathers == plan_.blocks[block].iterations) {
        ++block;
        gathers = 0;
      }
      if (block == plan_.blocks.size() || !(op.links == plan_.blocks[block].links))
        fail("its links are not those of block " + std::to_string(block));
      ++gathers;
    }
    if (block + 1 != plan_.blocks.size() || gathers != plan_.blocks[block].iterations)
      fail("block " + std::to_string(block) + " has fewer gathers than it says");
  }

  const LayerPlan& plan_;
  std::size_t number_ = 0;
  std::set<int> used_;
};

/// Writes a plan operation by operation.
class Planner {
 public:
  Planner(const std::string& name, const FeatureConfig& config, int64_t hidden, int64_t hidden_layers, double slope)
      : hidden_(hidden), hidden_layers_(hidden_layers), slope_(slope) {
    plan_.name = name;
    plan_.embedding = config.embedding;
    plan_.values.push_back({{RowSet::particles, 0}, config.input_width() - config.embedding});
  }

  /// Features of the edges of level 0, before the first operation.
  int edge_features(int64_t width) {
    plan_.inputs = 2;
    return add_value({RowSet::edges, 0}, width);
  }

  int encode(const std::string& layer) {
    return run({.kind = operation::encode, .sources = {{0}}}, {RowSet::particles, 0}, layer, hidden_, true);
  }
  int gather(const std::string& layer, const Links& links, const std::vector<PlanSource>& sources, bool linear,
             int residual = -1) {
    PlanOperation op{.kind = operation::gather, .links = links, .sources = sources};
    op.offset = links.offset() > 0 && !(sources.back().end == End::link);
    op.residual = residual;
    return run(op, links.rows(), layer, hidden_, !linear, linear);
  }
  int aggregate(const Links& links, int value, double scale = 1) {
    return run({.kind = operation::aggregate, .links = links, .sources = {{value}}, .scale = scale}, links.receiver(),
               "", width_of(value), false);
  }
  int update(const std::string& layer, const std::vector<int>& values, int residual = -1) {
    PlanOperation op{.kind = operation::update, .residual = residual};
    for (const int value : values) op.sources.push_back({value});
    return run(op, plan_.values[static_cast<std::size_t>(values.front())].rows, layer, hidden_, true);
  }
  int add(int a, int b) {
    return run({.kind = operation::add, .sources = {{a}, {b}}}, plan_.values[static_cast<std::size_t>(a)].rows, "",
               width_of(a), false);
  }
  void decode(const std::string& layer, int value, int64_t outputs) {
    run({.kind = operation::decode, .sources = {{value}}}, {RowSet::moving, 0}, layer, outputs, false);
  }
  void begin_stage() { plan_.stages.push_back(plan_.operations.size()); }
  void begin_block(const std::string& name, const Links& links, int64_t iterations = 1) {
    plan_.blocks.push_back({name, links, iterations, plan_.operations.size(), plan_.blocks.size()});
  }

  LayerPlan finish() {
    plan_.check();
    return std::move(plan_);
  }

 private:
  int64_t width_of(int value) const { return plan_.values[static_cast<std::size_t>(value)].width; }
  int add_value(const Rows& rows, int64_t width) {
    plan_.values.push_back({rows, width});
    return static_cast<int>(plan_.values.size()) - 1;
  }
  int run(PlanOperation op, const Rows& rows, const std::string& name, int64_t outputs, bool norm,
          bool linear = false) {
    if (!name.empty()) {
      PlanLayer layer{.name = name, .hidden = hidden_, .outputs = outputs, .slope = slope_, .norm = norm};
      layer.hidden_layers = linear ? 0 : hidden_layers_;
      layer.inputs = op.kind == operation::encode ? plan_.embedding : 0;
      for (const PlanSource& source : op.sources) layer.inputs += width_of(source.value);
      if (op.offset) layer.inputs += op.links.offset();
      op.layer = static_cast<int>(plan_.layers.size());
      plan_.layers.push_back(layer);
    }
    op.output = add_value(rows, outputs);
    plan_.operations.push_back(std::move(op));
    return plan_.operations.back().output;
  }

  LayerPlan plan_;
  int64_t hidden_, hidden_layers_;
  double slope_;
};

/// The hierarchical graph network (HGN paper, figure 2). Receivers sum the outputs of an FCN a message, as the paper
/// says, or activations of a linear layer, of which they take an FCN (docs/decisions/0011-sums-of-activations.md).
class HgnPlanner : Planner {
 public:
  explicit HgnPlanner(const HgnConfig& config)
      : Planner(hgn_architecture, config, config.latent, 1, hgn_leaky_slope),
        config_(config),
        activations_(config.aggregation == Aggregation::activations) {}

  LayerPlan plan() {
    const int particles = encode("encoder");
    std::vector<int> cells(static_cast<std::size_t>(config_.levels));
    const int top = static_cast<int>(config_.levels) - 1;
    const Links to_cells{LinkKind::particle_to_cell}, to_particles{LinkKind::cell_to_particle};
    cells[0] = transfer("particle_to_grid", to_cells, {{particles, End::sender}}, -1, config_.p2g_scale);
    for (int l = 0; l <= top; ++l) {
      int& own = cells[static_cast<std::size_t>(l)];
      own = pass_messages("down." + std::to_string(l), l, own);
      if (l < top)
        cells[static_cast<std::size_t>(l) + 1] =
            transfer("restrict." + std::to_string(l), {LinkKind::to_parent, l}, {{own, End::sender}}, -1);
    }
    for (int l = top - 1; l >= 0; --l) {
      int& own = cells[static_cast<std::size_t>(l)];
      const std::string prolong = "prolong." + std::to_string(l);
      const Links from_parent{LinkKind::from_parent, l};
      begin_block(prolong, from_parent);
      own = gather(prolong, from_parent, {{cells[static_cast<std::size_t>(l) + 1], End::sender}, {own, End::receiver}},
                   false, own);
      own = pass_messages("up." + std::to_string(l), l, own);
    }
    const int change =
        transfer("grid_to_particle", to_particles, {{cells[0], End::sender}, {particles, End::receiver}}, particles);
    decode("decoder", add(particles, change), config_.output_width());
    return finish();
  }

 private:
  /// What receivers make of what they gather; an FCN of activations also sees the receiver's own latents, if any.
  int transfer(const std::string& name, const Links& links, const std::vector<PlanSource>& sources, int own,
               double scale = 1) {
    begin_block(name, links);
    if (!activations_) return aggregate(links, gather(name, links, sources, false), scale);
    const int sums = aggregate(links, gather(name + ".gather", links, sources, true), scale);
    return update(name, own >= 0 ? std::vector<int>{sums, own} : std::vector<int>{sums});
  }

  int pass_messages(const std::string& name, int level, int nodes) {
    const Links links{LinkKind::cell_neighbors, level};
    begin_block(name, links, config_.message_passing);
    int latent = -1;  // of the edges; the first iteration sees their offsets
    for (int64_t k = 0; k < config_.message_passing; ++k) {
      begin_stage();
      const std::string at_k = name + "." + std::to_string(k);
      std::vector<PlanSource> sources = {{nodes, End::sender}, {nodes, End::receiver}};
      if (latent >= 0) sources.push_back({latent, End::link});
      const int messages = gather(at_k + (activations_ ? ".gather" : ".edge"), links, sources, activations_);
      nodes = update(at_k + ".cell", {aggregate(links, messages), nodes}, nodes);
      if (activations_ || k + 1 == config_.message_passing) continue;
      latent = k == 0 ? messages : add(latent, messages);
    }
    return nodes;
  }

  const HgnConfig& config_;
  bool activations_;
};

}  // namespace

void LayerPlan::check() const { Checker(*this).check(); }

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

void check_operations(const LayerPlan& plan, const std::string& engine, const std::vector<std::string>& known) {
  for (const PlanOperation& op : plan.operations) {
    if (std::find(known.begin(), known.end(), op.kind) != known.end()) continue;
    std::string words;
    for (const std::string& word : known) words += (words.empty() ? "" : ", ") + word;
    throw ConfigError("engine '" + engine + "' has no operation '" + op.kind + "', which plan '" + plan.name +
                      "' needs (it has: " + words + "). Teach it the operation, or choose another engine");
  }
}

LayerPlan plan_of(const HgnConfig& config) { return HgnPlanner(config).plan(); }

/// GNS (Sanchez-Gonzalez et al. 2020): particles and edges encoded, M steps with residuals, decoded.
LayerPlan plan_of(const GnsConfig& config) {
  Planner plan(gns_architecture, config, config.latent, config.hidden_layers, config.leaky_slope);
  const Links links{LinkKind::particle_neighbors};
  const int features = plan.edge_features(edge_feature_count);
  int nodes = plan.encode("encoder.node"), edges = plan.update("encoder.edge", {features});
  plan.begin_block("step", links, config.message_passing);
  for (int64_t k = 0; k < config.message_passing; ++k) {
    plan.begin_stage();
    const std::string step = "step." + std::to_string(k);
    const int messages =
        plan.gather(step + ".edge", links, {{nodes, End::sender}, {nodes, End::receiver}, {edges, End::link}}, false);
    nodes = plan.update(step + ".node", {plan.aggregate(links, messages), nodes}, nodes);
    if (k + 1 < config.message_passing) edges = plan.add(edges, messages);
  }
  plan.decode("decoder", nodes, config.output_width());
  return plan.finish();
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
