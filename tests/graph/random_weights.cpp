#include "random_weights.h"

#include <cmath>
#include <string>

#include "core/random.h"
#include "graph/normalization.h"

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

  void fcn(const std::string& name, int64_t in, int64_t hidden, int64_t out, bool norm, int64_t hidden_layers = 1) {
    for (int64_t l = 1; l <= hidden_layers + 1; ++l, in = hidden) {
      const double bound = 1 / std::sqrt(static_cast<double>(in));
      const int64_t rows = l <= hidden_layers ? hidden : out;
      fill(name + ".layer" + std::to_string(l) + ".weight", {rows, in}, 0, bound);
      fill(name + ".layer" + std::to_string(l) + ".bias", {rows}, 0, bound);
    }
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
  maker.fcn("particle_to_grid", h + 3, h, h, true);
  maker.fcn("grid_to_particle", 2 * h + 3, h, h, true);
  maker.fcn("decoder", h, h, 3, false);
  const auto block = [&](const std::string& name) {
    for (int64_t k = 0; k < config.message_passing; ++k) {
      const std::string prefix = name + "." + std::to_string(k);
      maker.fcn(prefix + ".edge", 2 * h + (k == 0 ? 3 : h), h, h, true);
      maker.fcn(prefix + ".cell", 2 * h, h, h, true);
    }
  };
  for (int64_t l = 0; l < config.levels; ++l) block("down." + std::to_string(l));
  for (int64_t l = 0; l + 1 < config.levels; ++l) {
    block("up." + std::to_string(l));
    maker.fcn("restrict." + std::to_string(l), h + 3, h, h, true);
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
  maker.fcn("decoder", h, h, 3, false, layers);
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
