// Names, shapes and places of the network's weights in one flat array, so that the optimiser, the moving average and
// the gradient norm are single operations. The names are those of graph/networks/hierarchical_graph_network.h and
// graph/networks/gns_network.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/weights.h"
#include "train/config/network_config.h"
#include "train/networks/graph_kernels.h"

namespace graupel::train {

/// One tensor of the network: `count` numbers from `begin` of the flat array, row-major.
struct Parameter {
  std::string name;
  std::vector<int64_t> shape;
  int64_t begin = 0, count = 0;
  int64_t fan_in = 0;  ///< inputs of the linear layer it belongs to; 0 for norms and the embedding
};

/// A fully connected network of the architecture: inputs -> H (once or more) -> outputs, then a layer norm but for the
/// decoder.
struct FcnShape {
  std::string name;  ///< e.g. "down.0.1.edge"
  int64_t inputs = 0, outputs = 0;
  bool norm = true;
  int64_t hidden_layers = 1;
  double slope = leaky_slope;  ///< of the activation
};

/// A plain linear layer inputs -> H in front of an activation that a receiver sums (graph/config/hgn_config.h,
/// Aggregation).
struct GatherShape {
  std::string name;  ///< e.g. "down.0.1.gather"
  int64_t inputs = 0;
};

class ParameterLayout {
 public:
  explicit ParameterLayout(const NetworkConfig& config);

  int64_t size() const { return size_; }              ///< numbers of the flat array, gaps for alignment included
  int64_t parameter_count() const { return count_; }  ///< numbers that are weights
  const std::vector<Parameter>& parameters() const { return parameters_; }
  const std::vector<FcnShape>& fcns() const { return fcns_; }
  const std::vector<GatherShape>& gathers() const { return gathers_; }
  const Parameter& find(const std::string& name) const;

  /// PyTorch's defaults from Graupel's own generator: linear layers uniform in +-1/sqrt(fan_in), embedding N(0, 1),
  /// norms one and zero. The same seed gives the same numbers with any libtorch.
  std::vector<float> initial_values(uint64_t seed) const;

  nn::Weights to_weights(const std::vector<float>& flat) const;
  /// Throws InputError when a tensor is missing or of another shape.
  std::vector<float> from_weights(const nn::Weights& weights) const;

 private:
  void add_hgn(const graph::HgnConfig& config);
  /// A transfer to receivers that gather from `nodes` latents and an offset.
  void add_transfer(const graph::HgnConfig& config, const std::string& name, int64_t nodes);
  void add_gather(const std::string& name, int64_t inputs, int64_t hidden);
  void add_linear(const std::string& name, int64_t outputs, int64_t inputs);
  void add_gns(const graph::GnsConfig& config);
  void add(const std::string& name, std::vector<int64_t> shape, int64_t fan_in);
  void add_fcn(const FcnShape& shape, int64_t hidden);
  void add_fcn(const std::string& name, int64_t inputs, int64_t outputs, bool norm, int64_t hidden) {
    add_fcn({name, inputs, outputs, norm}, hidden);
  }

  std::vector<Parameter> parameters_;
  std::vector<FcnShape> fcns_;
  std::vector<GatherShape> gathers_;
  int64_t size_ = 0, count_ = 0;
};

}  // namespace graupel::train
