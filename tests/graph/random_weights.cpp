#include "random_weights.h"

#include <cmath>
#include <string>

#include "core/math/random.h"
#include "graph/features/normalization.h"

namespace graupel::graph {

namespace {

class Maker {
 public:
  Maker(nn::Weights& weights, uint64_t seed) : weights_(weights), random_(seed, RandomPurpose::test) {}

  void fill(const std::string& name, std::vector<int64_t> shape, double middle, double half_width) {
    std::size_t n = 1;
    for (const int64_t extent : shape) n *= static_cast<std::size_t>(extent);
    std::vector<float> values(n);
    for (float& v : values)
      v = static_cast<float>(random_.uniform(draw_++, 0, middle - half_width, middle + half_width));
    weights_.tensors[name] = nn::Tensor::from_float(values, std::move(shape));
  }

  void layer(const std::string& name, int64_t in, int64_t out) {
    const double bound = 1 / std::sqrt(static_cast<double>(in));
    fill(name + ".weight", {out, in}, 0, bound);
    fill(name + ".bias", {out}, 0, bound);
  }

  void fcn(const std::string& name, int64_t in, int64_t hidden, int64_t out, bool norm, int64_t hidden_layers = 1) {
    for (int64_t l = 1; l <= hidden_layers + 1; ++l, in = hidden)
      layer(name + ".layer" + std::to_string(l), in, l <= hidden_layers ? hidden : out);
    if (!norm) return;
    fill(name + ".norm.weight", {out}, 1, 0.2);
    fill(name + ".norm.bias", {out}, 0, 0.2);
  }

 private:
  nn::Weights& weights_;
  Random random_;
  uint64_t draw_ = 0;
};

}  // namespace

nn::Weights random_weights(const HgnConfig& config, const Normalization& normalization, uint64_t seed) {
  nn::Weights weights;
  weights.file = "random.safetensors";
  weights.metadata = config.to_metadata();
  add_normalization(weights, normalization);
  Maker maker(weights, seed);
  const int64_t h = config.latent;
  maker.fill("embedding.weight", {9, config.embedding}, 0, 1);
  maker.fcn("encoder", config.input_width(), h, h, true);
  const bool sums_activations = config.aggregation == Aggregation::activations;
  /// A transfer to receivers that gather from `nodes` latents and an offset.
  const auto transfer = [&](const std::string& name, int64_t nodes) {
    if (sums_activations) maker.layer(name + ".gather", nodes * h + 3, h);
    maker.fcn(name, nodes * h + (sums_activations ? 0 : 3), h, h, true);
  };
  transfer("particle_to_grid", 1);
  transfer("grid_to_particle", 2);
  maker.fcn("decoder", h, h, config.output_width(), false);
  const auto block = [&](const std::string& name) {
    for (int64_t k = 0; k < config.message_passing; ++k) {
      const std::string prefix = name + "." + std::to_string(k);
      if (sums_activations)
        maker.layer(prefix + ".gather", 2 * h + 3, h);
      else
        maker.fcn(prefix + ".edge", 2 * h + (k == 0 ? 3 : h), h, h, true);
      maker.fcn(prefix + ".cell", 2 * h, h, h, true);
    }
  };
  for (int64_t l = 0; l < config.levels; ++l) block("down." + std::to_string(l));
  for (int64_t l = 0; l + 1 < config.levels; ++l) {
    block("up." + std::to_string(l));
    transfer("restrict." + std::to_string(l), 1);
    maker.fcn("prolong." + std::to_string(l), 2 * h + 3, h, h, true);
  }
  return weights;
}

nn::Weights random_weights(const GnsConfig& config, const Normalization& normalization, uint64_t seed) {
  nn::Weights weights;
  weights.file = "random.safetensors";
  weights.metadata = config.to_metadata();
  add_normalization(weights, normalization);
  Maker maker(weights, seed);
  const int64_t h = config.latent, layers = config.hidden_layers;
  maker.fill("embedding.weight", {9, config.embedding}, 0, 1);
  maker.fcn("encoder.node", config.input_width(), h, h, true, layers);
  maker.fcn("encoder.edge", 4, h, h, true, layers);
  for (int64_t k = 0; k < config.message_passing; ++k) {
    const std::string prefix = "step." + std::to_string(k);
    maker.fcn(prefix + ".edge", 3 * h, h, h, true, layers);
    maker.fcn(prefix + ".node", 2 * h, h, h, true, layers);
  }
  maker.fcn("decoder", h, h, config.output_width(), false, layers);
  return weights;
}

void silence_decoder(nn::Weights& weights) {
  for (const char* name : {"decoder.layer2.weight", "decoder.layer2.bias"}) {
    nn::Tensor& tensor = weights.tensors.at(name);
    tensor.bytes.assign(tensor.bytes.size(), std::byte{0});
  }
}

std::vector<Vec3f> blobs(int count, int particles, double radius, uint64_t seed) {
  const Random random(seed, RandomPurpose::test, 77);
  std::vector<Vec3f> position;
  for (int i = 0; i < particles; ++i) {
    const auto blob = static_cast<uint64_t>(i % count);
    Vec3f x;
    for (int axis = 0; axis < 3; ++axis)
      x[axis] = static_cast<float>(random.uniform(blob, axis, 0.2, 0.8) +
                                   random.uniform(1000 + static_cast<uint64_t>(i), axis, -radius, radius));
    position.push_back(x);
  }
  return position;
}

}  // namespace graupel::graph
