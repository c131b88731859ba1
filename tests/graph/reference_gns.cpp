#include "reference_gns.h"

#include <cmath>
#include <map>
#include <string>

#include "graph/config/gns_config.h"

namespace graupel::graph {

namespace {

using Row = std::vector<double>;

Row join(std::initializer_list<Row> parts) {
  Row all;
  for (const Row& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

void add(Row& sum, const Row& x) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += x[i];
}

class Networks {
 public:
  Networks(const nn::Weights& weights, const GnsConfig& config) : config_(config) {
    for (const auto& [name, tensor] : weights.tensors)
      for (const float v : tensor.as_float()) values_[name].push_back(v);
  }
  const Row& values(const std::string& name) const { return values_.at(name); }

  Row operator()(const std::string& name, Row x) const {
    for (int64_t l = 1; l <= config_.hidden_layers; ++l) {
      x = linear(name + ".layer" + std::to_string(l), x);
      for (double& v : x) v = v > 0 ? v : config_.leaky_slope * v;
    }
    Row y = linear(name + ".layer" + std::to_string(config_.hidden_layers + 1), x);
    if (!values_.count(name + ".norm.weight")) return y;
    const auto n = static_cast<double>(y.size());
    double mean = 0, variance = 0;
    for (const double v : y) mean += v / n;
    for (const double v : y) variance += (v - mean) * (v - mean) / n;
    const Row &gamma = values(name + ".norm.weight"), &beta = values(name + ".norm.bias");
    for (std::size_t i = 0; i < y.size(); ++i) y[i] = (y[i] - mean) / std::sqrt(variance + 1e-5) * gamma[i] + beta[i];
    return y;
  }

 private:
  Row linear(const std::string& name, const Row& x) const {
    const Row& weight = values(name + ".weight");
    Row y = values(name + ".bias");
    for (std::size_t o = 0; o < y.size(); ++o)
      for (std::size_t i = 0; i < x.size(); ++i) y[o] += weight[o * x.size() + i] * x[i];
    return y;
  }

  const GnsConfig& config_;
  std::map<std::string, Row> values_;
};

}  // namespace

std::vector<double> reference_gns(const nn::Weights& weights, const std::vector<float>& features,
                                  const std::vector<int32_t>& particle_type, const std::vector<Vec3f>& position) {
  const GnsConfig config = GnsConfig::from_metadata(weights.metadata, weights.file);
  const Networks network(weights, config);
  const std::size_t n = position.size();
  const auto embedding = static_cast<std::size_t>(config.embedding);
  const std::size_t own = static_cast<std::size_t>(config.input_width()) - embedding;
  std::vector<Row> node;
  std::map<std::pair<std::size_t, std::size_t>, Row> edge;  // (sender, receiver)
  for (std::size_t i = 0; i < n; ++i) {
    Row input(features.begin() + static_cast<std::ptrdiff_t>(i * own),
              features.begin() + static_cast<std::ptrdiff_t>((i + 1) * own));
    for (std::size_t e = 0; e < embedding; ++e)
      input.push_back(network.values("embedding.weight")[static_cast<std::size_t>(particle_type[i]) * embedding + e]);
    node.push_back(network("encoder.node", input));
  }
  for (std::size_t s = 0; s < n; ++s)
    for (std::size_t r = 0; r < n; ++r) {
      const Vec3d d = (position[s].cast<double>() - position[r].cast<double>()) * (1 / config.radius);
      if (norm(d) <= 1) edge[{s, r}] = network("encoder.edge", {d[0], d[1], d[2], norm(d)});
    }
  for (int64_t k = 0; k < config.message_passing; ++k) {
    const std::string step = "step." + std::to_string(k);
    std::vector<Row> received(n, Row(static_cast<std::size_t>(config.latent), 0.0));
    for (auto& [ends, latent] : edge) {
      const Row out = network(step + ".edge", join({node[ends.first], node[ends.second], latent}));
      add(received[ends.second], out);
      add(latent, out);
    }
    for (std::size_t i = 0; i < n; ++i) add(node[i], network(step + ".node", join({received[i], node[i]})));
  }
  std::vector<double> acceleration;
  for (const Row& f : node)
    for (const double a : network("decoder", f)) acceleration.push_back(a);
  return acceleration;
}

}  // namespace graupel::graph
