#include "train/networks/parameter_layout.h"

#include <algorithm>
#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "graph/features/features.h"
#include "graph/topology/gns_graph.h"

namespace graupel::train {

namespace {
constexpr int64_t alignment = 64;  // numbers: every tensor starts on a 256-byte boundary
}

ParameterLayout::ParameterLayout(const NetworkConfig& config) {
  if (const auto* hgn = std::get_if<graph::HgnConfig>(&config)) add_hgn(*hgn);
  if (const auto* gns = std::get_if<graph::GnsConfig>(&config)) add_gns(*gns);
}

void ParameterLayout::add_gns(const graph::GnsConfig& config) {
  const int64_t h = config.latent;
  const auto fcn = [&](const std::string& name, int64_t inputs, int64_t outputs, bool norm) {
    add_fcn({name, inputs, outputs, norm, config.hidden_layers, config.leaky_slope}, h);
  };
  add("embedding.weight", {graph::embedding_rows, config.embedding}, 0);
  fcn("encoder.node", config.input_width(), h, true);
  fcn("encoder.edge", graph::edge_feature_count, h, true);
  for (int64_t k = 0; k < config.message_passing; ++k) {
    fcn("step." + std::to_string(k) + ".edge", 3 * h, h, true);
    fcn("step." + std::to_string(k) + ".node", 2 * h, h, true);
  }
  fcn("decoder", h, config.output_width(), false);
}

void ParameterLayout::add_hgn(const graph::HgnConfig& config) {
  const int64_t h = config.latent;
  const auto block = [&](const std::string& name) {
    for (int64_t k = 0; k < config.message_passing; ++k) {
      const std::string at = name + "." + std::to_string(k);
      if (config.aggregation == graph::Aggregation::activations)
        add_gather(at, 2 * h + 3, h);
      else
        add_fcn(at + ".edge", k == 0 ? 2 * h + 3 : 3 * h, h, true, h);
      add_fcn(at + ".cell", 2 * h, h, true, h);
    }
  };
  add("embedding.weight", {graph::embedding_rows, config.embedding}, 0);
  add_fcn("encoder", config.input_width(), h, true, h);
  add_transfer(config, "particle_to_grid", 1);
  for (int64_t l = 0; l < config.levels; ++l) {
    block("down." + std::to_string(l));
    if (l + 1 < config.levels) add_transfer(config, "restrict." + std::to_string(l), 1);
  }
  for (int64_t l = config.levels - 2; l >= 0; --l) {
    add_fcn("prolong." + std::to_string(l), 2 * h + 3, h, true, h);
    block("up." + std::to_string(l));
  }
  add_transfer(config, "grid_to_particle", 2);
  add_fcn("decoder", h, config.output_width(), false, h);
}

void ParameterLayout::add_transfer(const graph::HgnConfig& config, const std::string& name, int64_t nodes) {
  const int64_t h = config.latent;
  const bool sums_activations = config.aggregation == graph::Aggregation::activations;
  if (sums_activations) add_gather(name, nodes * h + 3, h);
  add_fcn(name, nodes * h + (sums_activations ? 0 : 3), h, true, h);
}

void ParameterLayout::add_gather(const std::string& name, int64_t inputs, int64_t hidden) {
  gathers_.push_back({name + ".gather", inputs});
  add_linear(gathers_.back().name, hidden, inputs);
}

void ParameterLayout::add_linear(const std::string& name, int64_t outputs, int64_t inputs) {
  add(name + ".weight", {outputs, inputs}, inputs);
  add(name + ".bias", {outputs}, inputs);
}

void ParameterLayout::add(const std::string& name, std::vector<int64_t> shape, int64_t fan_in) {
  int64_t count = 1;
  for (const int64_t n : shape) count *= n;
  parameters_.push_back({name, std::move(shape), size_, count, fan_in});
  size_ += (count + alignment - 1) / alignment * alignment;
  count_ += count;
}

void ParameterLayout::add_fcn(const FcnShape& shape, int64_t hidden) {
  fcns_.push_back(shape);
  for (int64_t l = 1; l <= shape.hidden_layers + 1; ++l) {
    const std::string layer = shape.name + ".layer" + std::to_string(l);
    add_linear(layer, l <= shape.hidden_layers ? hidden : shape.outputs, l == 1 ? shape.inputs : hidden);
  }
  if (!shape.norm) return;
  add(shape.name + ".norm.weight", {shape.outputs}, 0);
  add(shape.name + ".norm.bias", {shape.outputs}, 0);
}

const Parameter& ParameterLayout::find(const std::string& name) const {
  const auto at =
      std::find_if(parameters_.begin(), parameters_.end(), [&](const Parameter& p) { return p.name == name; });
  GRAUPEL_ASSERT(at != parameters_.end());
  return *at;
}

std::vector<float> ParameterLayout::initial_values(uint64_t seed) const {
  std::vector<float> flat(static_cast<std::size_t>(size_), 0.0f);
  for (std::size_t p = 0; p < parameters_.size(); ++p) {
    const Parameter& parameter = parameters_[p];
    const Random random(seed, RandomPurpose::weight_init, p);
    float* const values = flat.data() + parameter.begin;
    const double bound = parameter.fan_in > 0 ? 1 / std::sqrt(static_cast<double>(parameter.fan_in)) : 0;
    for (int64_t i = 0; i < parameter.count; ++i) {
      const auto draw = static_cast<uint64_t>(i / 4);
      const int c = static_cast<int>(i % 4);
      if (parameter.fan_in > 0) {
        values[i] = static_cast<float>(random.uniform(draw, c, -bound, bound));
      } else if (parameter.name == "embedding.weight") {
        double a, b;
        random.normal(draw, c / 2, a, b);
        values[i] = static_cast<float>(c % 2 == 0 ? a : b);
      } else {
        values[i] = parameter.name.ends_with(".norm.weight") ? 1.0f : 0.0f;
      }
    }
  }
  return flat;
}

nn::Weights ParameterLayout::to_weights(const std::vector<float>& flat) const {
  GRAUPEL_ASSERT(static_cast<int64_t>(flat.size()) == size_);
  nn::Weights weights;
  for (const Parameter& p : parameters_)
    weights.tensors[p.name] =
        nn::Tensor::from_float({flat.begin() + p.begin, flat.begin() + p.begin + p.count}, p.shape);
  return weights;
}

std::vector<float> ParameterLayout::from_weights(const nn::Weights& weights) const {
  std::vector<float> flat(static_cast<std::size_t>(size_), 0.0f);
  for (const Parameter& p : parameters_) {
    const std::vector<float> values = weights.get(p.name, p.shape);
    std::copy(values.begin(), values.end(), flat.begin() + p.begin);
  }
  return flat;
}

}  // namespace graupel::train
