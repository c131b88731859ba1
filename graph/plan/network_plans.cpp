// The plans of HGN in both forms and of GNS.
#include <utility>

#include "graph/plan/layer_plan.h"
#include "graph/topology/gns_graph.h"

namespace graupel::graph {

namespace {

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

}  // namespace graupel::graph
