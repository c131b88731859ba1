#include "train/networks/torch_engine.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/embedding_bag.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/index_select.h>
#include <ATen/ops/layer_norm.h>
#include <ATen/ops/leaky_relu.h>
#include <ATen/ops/leaky_relu_backward.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/neg.h>
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/custom_function.h>

#include <algorithm>

#include "core/system/error.h"

namespace graupel::train {

namespace {

using graph::End;
using graph::FirstLayers;
using graph::LinkKind;
using graph::PlanLayer;
using graph::PlanOperation;
using graph::PlanSource;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

constexpr int64_t corners = 8;
constexpr double norm_epsilon = 1e-5;

/// Autograd's functions keep the address of the links, which live as long as the pass (LinkCache).
int64_t address_of(const TorchLinks& links) { return reinterpret_cast<int64_t>(&links); }
const TorchLinks& kept_links(AutogradContext* ctx) {
  return *reinterpret_cast<const TorchLinks*>(ctx->saved_data["links"].toInt());
}

/// a(x_l + s_sender(l) + r_receiver(l)) for each link l; s or r may be empty. The kernel writes over x.
struct GatherActivate : torch::autograd::Function<GatherActivate> {
  static at::Tensor compute(const at::Tensor& own, const at::Tensor& sent, const at::Tensor& received,
                            const TorchLinks& links, double slope) {
    add_ends_and_activate(own, links.sender, sent, links.receiver, received, slope);
    return own;
  }
  static at::Tensor forward(AutogradContext* ctx, at::Tensor own, const at::Tensor& sent, const at::Tensor& received,
                            int64_t links, double slope) {
    compute(own, sent, received, *reinterpret_cast<const TorchLinks*>(links), slope);
    ctx->mark_dirty({own});
    ctx->save_for_backward({own});
    ctx->saved_data["links"] = links;
    ctx->saved_data["slope"] = slope;
    ctx->saved_data["sent"] = sent.numel() > 0;
    ctx->saved_data["received"] = received.numel() > 0;
    return own;
  }
  static variable_list backward(AutogradContext* ctx, variable_list gradients) {
    const TorchLinks& links = kept_links(ctx);
    const at::Tensor own = at::leaky_relu_backward(gradients[0].contiguous(), ctx->get_saved_variables()[0],
                                                   ctx->saved_data["slope"].toDouble(), /*self_is_result=*/true);
    at::Tensor sent, received;
    if (ctx->saved_data["sent"].toBool()) sent = sum_at(links.sender, own, {});
    if (ctx->saved_data["received"].toBool()) received = sum_at(links.receiver, own, {});
    return {own, sent, received, {}, {}};
  }
};

/// sum over the links of each receiver of weight * row.
struct SumAtReceivers : torch::autograd::Function<SumAtReceivers> {
  static at::Tensor forward(AutogradContext* ctx, const at::Tensor& rows, int64_t address) {
    ctx->saved_data["links"] = address;
    const TorchLinks& links = kept_links(ctx);
    return sum_at(links.receiver, rows, links.weight);
  }
  static variable_list backward(AutogradContext* ctx, variable_list gradients) {
    const TorchLinks& links = kept_links(ctx);
    return {rows_at(links.receiver, links.count, gradients[0], links.weight), {}};
  }
};

/// Offsets (x - centre) / R of the pairs, [particles * 8, 3].
at::Tensor pair_offsets(const at::Tensor& offset) {
  const at::Tensor corner = at::arange(corners, offset.options().dtype(at::kInt)).view({-1, 1});
  const at::Tensor axis = at::arange(3, corner.options()).view({1, 3});
  const at::Tensor bits = corner.__rshift__(axis).bitwise_and(1).to(offset.dtype());
  return (offset.unsqueeze(1) - bits).reshape({-1, 3});
}

TorchLinks links_of(const graph::Links& links, const DeviceBatch& batch) {
  const DeviceLevel& level = batch.level[static_cast<std::size_t>(links.level)];
  const LinkEnd own_row, particle{{}, 3, {}, {}};
  switch (links.kind) {
    case LinkKind::particle_to_cell:
      return {corners * batch.particles,
              particle,
              {batch.cell, 0, batch.pair_begin, batch.pair},
              batch.weight,
              at::neg(pair_offsets(batch.offset))};
    case LinkKind::cell_to_particle:
      return {corners * batch.particles,
              {batch.cell, 0, batch.pair_begin, batch.pair},
              particle,
              batch.weight,
              pair_offsets(batch.offset)};
    case LinkKind::cell_neighbors:
    case LinkKind::particle_neighbors:
      return {level.sender.size(0),
              {level.sender, 0, level.edge_begin, level.reverse},
              {level.receiver, 0, level.edge_begin, {}},
              {},
              links.kind == LinkKind::cell_neighbors ? level.direction : at::Tensor()};
    case LinkKind::to_parent:
      return {level.cells, own_row, {level.parent, 0, level.child_begin, level.child}, {}, level.parent_offset};
    case LinkKind::from_parent:
      return {
          level.cells, {level.parent, 0, level.child_begin, level.child}, own_row, {}, at::neg(level.parent_offset)};
  }
  return {};
}

/// The same as SumAtReceivers by libtorch's own operations. An embedding bag is its one parallel sum over segments on a
/// CPU: index_add takes one row after the other.
at::Tensor sum_by_bags(const at::Tensor& rows, const TorchLinks& links) {
  constexpr int64_t sum_of_bag = 0;
  const LinkEnd& end = links.receiver;
  if (!end.begin.defined()) {
    const at::Tensor weighted = links.weight.defined() ? rows * links.weight.view({-1, 1}) : rows;
    return weighted.view({-1, int64_t{1} << end.shift, rows.size(1)}).sum(1);
  }
  const at::Tensor item = end.item.defined() ? end.item : at::arange(links.count, end.begin.options());
  const at::Tensor weight = links.weight.defined() ? at::index_select(links.weight, 0, item) : at::Tensor();
  return std::get<0>(at::embedding_bag(rows, item, end.begin, false, sum_of_bag, false, weight,
                                       /*include_last_offset=*/true));
}

at::Tensor concatenated(const std::vector<at::Tensor>& parts) {
  return parts.size() == 1 ? parts[0] : at::cat(parts, 1);
}

}  // namespace

const TorchLinks& TorchEngine::LinkCache::of(const graph::Links& links) {
  for (const auto& [known, made] : made_)
    if (known == links) return *made;
  return *made_.emplace_back(links, std::make_unique<TorchLinks>(links_of(links, batch_))).second;
}

const TorchLinks& TorchEngine::Context::links() const { return cache.of(operation.links); }
const at::Tensor& TorchEngine::Context::source(std::size_t i) const {
  return values[static_cast<std::size_t>(operation.sources[i].value)];
}
const PlanLayer& TorchEngine::Context::layer() const { return engine.layer_of(operation); }
const at::Tensor& TorchEngine::Context::parameter(const std::string& name) const {
  return engine.parameter(layer().name + name);
}
const at::Tensor& TorchEngine::Context::embedding() const { return engine.parameter("embedding.weight"); }

TorchEngine::TorchEngine(const ParameterLayout& layout, const at::Tensor& flat, int64_t checkpoint_stages)
    : layout_(layout), flat_(flat), checkpoint_stages_(checkpoint_stages) {
  for (const Parameter& parameter : layout_.parameters()) {
    index_[parameter.name] = parameters_.size();
    parameters_.push_back(view_of(parameter, flat).detach().set_requires_grad(true));
  }
  last_use_.assign(plan().values.size(), 0);
  for (std::size_t i = 0; i < plan().operations.size(); ++i) {
    const PlanOperation& op = plan().operations[i];
    for (const PlanSource& source : op.sources) last_use_[static_cast<std::size_t>(source.value)] = i;
    if (op.residual >= 0) last_use_[static_cast<std::size_t>(op.residual)] = i;
  }
  last_use_.back() = plan().operations.size();

  using namespace graph::operation;
  operations_[encode] = [this](const Context& c) {
    const at::Tensor types = at::mm(c.batch.type_one_hot, c.embedding());
    return fcn(layer_of(c.operation), at::cat({c.source(0), types}, 1));
  };
  operations_[graph::operation::gather] = [this](const Context& c) { return this->gather(c); };
  operations_[aggregate] = [](const Context& c) {
    const TorchLinks& links = c.links();
    const at::Tensor sums = c.first_layers == FirstLayers::whole ? sum_by_bags(c.source(0), links)
                            : at::GradMode::is_enabled()         ? SumAtReceivers::apply(c.source(0), address_of(links))
                                                                 : sum_at(links.receiver, c.source(0), links.weight);
    return c.operation.scale == 1 ? sums : sums * c.operation.scale;
  };
  operations_[update] = [this](const Context& c) {
    std::vector<at::Tensor> inputs;
    for (std::size_t i = 0; i < c.operation.sources.size(); ++i) inputs.push_back(c.source(i));
    return fcn(layer_of(c.operation), concatenated(inputs));
  };
  operations_[add] = [](const Context& c) { return c.source(0) + c.source(1); };
  operations_[decode] = [this](const Context& c) {
    return fcn(layer_of(c.operation), c.source(0).narrow(0, 0, c.batch.particles));
  };
}

std::vector<at::Tensor> TorchEngine::given(const DeviceBatch& batch) const {
  std::vector<at::Tensor> values(plan().values.size());
  values[0] = batch.features;
  if (plan().inputs > 1) values[1] = batch.level.front().direction;
  return values;
}

void TorchEngine::run(LinkCache& links, std::size_t begin, std::size_t end, std::vector<at::Tensor>& values,
                      FirstLayers first_layers) const {
  for (std::size_t i = begin; i < end; ++i) {
    const PlanOperation& op = plan().operations[i];
    const auto known = operations_.find(op.kind);
    if (known == operations_.end()) {
      std::vector<std::string> words;
      for (const auto& [kind, operation] : operations_) words.push_back(kind);
      check_operations(plan(), "libtorch", words);
    }
    at::Tensor result = known->second({*this, op, links.batch(), values, first_layers, links});
    if (op.residual >= 0) result = values[static_cast<std::size_t>(op.residual)] + result;
    values[static_cast<std::size_t>(op.output)] = std::move(result);
    if (at::GradMode::is_enabled()) continue;
    for (const PlanSource& source : op.sources)
      if (last_use_[static_cast<std::size_t>(source.value)] == i)
        values[static_cast<std::size_t>(source.value)].reset();
  }
}

at::Tensor TorchEngine::forward(const DeviceBatch& batch, FirstLayers first_layers) const {
  const at::NoGradGuard no_grad;
  LinkCache links(batch);
  std::vector<at::Tensor> values = given(batch);
  run(links, 0, plan().operations.size(), values, first_layers);
  return values.back();
}

std::vector<std::size_t> TorchEngine::parts() const {
  std::vector<std::size_t> begin = {0};
  if (checkpoint_stages_ > 0)
    for (std::size_t s = 0; s < plan().stages.size(); s += static_cast<std::size_t>(checkpoint_stages_))
      if (plan().stages[s] > 0) begin.push_back(plan().stages[s]);
  begin.push_back(plan().operations.size());
  return begin;
}

void TorchEngine::backward(const DeviceBatch& batch, const at::Tensor& gradient,
                           const std::function<at::Tensor(const at::Tensor&)>& gradient_of) const {
  const std::vector<std::size_t> part = parts();
  LinkCache links(batch);
  const std::size_t inputs = static_cast<std::size_t>(plan().inputs);
  // Forward, all parts but the last without a gradient; kept[p]: the values that part p or a later one reads.
  std::vector<std::vector<at::Tensor>> kept = {given(batch)};
  for (std::size_t p = 0; p + 2 < part.size(); ++p) {
    const at::NoGradGuard no_grad;
    std::vector<at::Tensor> values = kept.back();
    run(links, part[p], part[p + 1], values, FirstLayers::split);
    for (std::size_t v = inputs; v < values.size(); ++v)
      if (last_use_[v] < part[p + 1]) values[v].reset();
    kept.push_back(std::move(values));
  }

  std::vector<at::Tensor> gradients(plan().values.size());  // of values, from the parts behind
  std::vector<at::Tensor> of_parameter(parameters_.size());
  for (std::size_t p = part.size() - 1; p-- > 0;) {
    const at::AutoGradMode with_grad(true);
    std::vector<at::Tensor> values = std::move(kept[p]);
    std::vector<std::size_t> read;
    variable_list leaves = parameters_;
    for (std::size_t v = inputs; v < values.size(); ++v)
      if (values[v].defined()) {
        values[v] = values[v].detach().set_requires_grad(true);
        read.push_back(v);
        leaves.push_back(values[v]);
      }
    run(links, part[p], part[p + 1], values, FirstLayers::split);
    if (p + 2 == part.size()) gradients.back() = gradient_of(values.back().detach());
    variable_list ends, of_ends;
    for (std::size_t i = part[p]; i < part[p + 1]; ++i) {
      const auto v = static_cast<std::size_t>(plan().operations[i].output);
      if (!gradients[v].defined()) continue;
      ends.push_back(values[v]);
      of_ends.push_back(std::move(gradients[v]));
      gradients[v].reset();
    }
    values.clear();
    const variable_list found = torch::autograd::grad(ends, leaves, of_ends, /*retain_graph=*/false,
                                                      /*create_graph=*/false, /*allow_unused=*/true);
    for (std::size_t i = 0; i < parameters_.size(); ++i)
      if (found[i].defined()) of_parameter[i] = found[i];
    for (std::size_t i = 0; i < read.size(); ++i) {
      const at::Tensor& more = found[parameters_.size() + i];
      at::Tensor& sum = gradients[read[i]];
      if (more.defined()) sum = sum.defined() ? sum + more : more;
    }
  }
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    at::Tensor view = view_of(layout_.parameters()[i], gradient);
    if (of_parameter[i].defined())
      view.copy_(of_parameter[i]);
    else
      view.zero_();
  }
}

at::Tensor TorchEngine::gather(const Context& context) const {
  const PlanLayer& layer = layer_of(context.operation);
  const at::Tensor hidden = first_layer_of_links(layer, context, context.links());
  return layer.is_linear() ? hidden : behind_first(layer, hidden);
}

/// a(W [sources of a link, its offset] + b). What lies at own rows of the links enters as it is; it stands last.
at::Tensor TorchEngine::first_layer_of_links(const PlanLayer& layer, const Context& context,
                                             const TorchLinks& links) const {
  const PlanOperation& op = context.operation;
  const std::string first = layer.is_linear() ? layer.name : layer.name + ".layer1";
  const at::Tensor &w = parameter(first + ".weight"), &b = parameter(first + ".bias");
  std::vector<at::Tensor> own;
  const at::Tensor none = at::empty({0}, w.options());
  at::Tensor sent = none, received = none;
  int64_t column = 0;
  for (std::size_t i = 0; i < op.sources.size(); ++i) {
    const End end = op.sources[i].end;
    const LinkEnd& at_end = end == End::sender ? links.sender : links.receiver;
    const at::Tensor& rows = context.source(i);
    if (end == End::link || at_end.is_own_row()) {
      own.push_back(rows);
    } else if (context.first_layers == FirstLayers::whole) {
      own.push_back(at_end.index.defined()
                        ? at::index_select(rows, 0, at_end.index)
                        : rows.unsqueeze(1).expand({-1, int64_t{1} << at_end.shift, -1}).reshape({-1, rows.size(1)}));
    } else {
      GRAUPEL_ASSERT(own.empty());
      (end == End::sender ? sent : received) = at::mm(rows, w.narrow(1, column, rows.size(1)).t());
      column += rows.size(1);
    }
  }
  if (op.offset) own.push_back(links.offset);
  at::Tensor hidden = at::addmm(b, concatenated(own), w.narrow(1, column, w.size(1) - column).t());
  if (sent.numel() + received.numel() == 0) return at::leaky_relu(hidden, layer.slope);
  if (!at::GradMode::is_enabled()) return GatherActivate::compute(hidden, sent, received, links, layer.slope);
  return GatherActivate::apply(hidden, sent, received, address_of(links), layer.slope);
}

at::Tensor TorchEngine::fcn(const PlanLayer& layer, const at::Tensor& input) const {
  const at::Tensor sum =
      at::addmm(parameter(layer.name + ".layer1.bias"), input, parameter(layer.name + ".layer1.weight").t());
  return behind_first(layer, at::leaky_relu(sum, layer.slope));
}

at::Tensor TorchEngine::behind_first(const PlanLayer& layer, at::Tensor hidden) const {
  const auto matrix = [&](int64_t l) {
    const std::string name = layer.name + ".layer" + std::to_string(l);
    return at::addmm(parameter(name + ".bias"), hidden, parameter(name + ".weight").t());
  };
  for (int64_t l = 2; l <= layer.hidden_layers; ++l) hidden = at::leaky_relu(matrix(l), layer.slope);
  const at::Tensor raw = matrix(layer.hidden_layers + 1);
  if (!layer.norm) return raw;
  return at::layer_norm(raw, {raw.size(1)}, parameter(layer.name + ".norm.weight"),
                        parameter(layer.name + ".norm.bias"), norm_epsilon, /*cudnn_enable=*/false);
}

}  // namespace graupel::train
