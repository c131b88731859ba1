#include "train/reduced/mlp/mlp_parameters.h"

#include <cmath>

#include "core/math/random.h"
#include "rom/networks/conv_encoder.h"

namespace graupel::train {

using rom::ConvEncoder;
using rom::Mlp;

namespace {

constexpr int64_t alignment = 64;  ///< in numbers

int64_t aligned(int64_t count) { return (count + alignment - 1) / alignment * alignment; }

void add_layer(const std::string& name, std::vector<int64_t> weight, int64_t fan_in, int64_t fan_out,
               std::vector<MlpParameter>& list) {
  const int64_t begin = aligned(flat_size(list)), outputs = weight.front();
  int64_t count = 1;
  for (const int64_t extent : weight) count *= extent;
  list.push_back({name + ".weight", std::move(weight), begin, count, fan_in, fan_out});
  list.push_back({name + ".bias", {outputs}, aligned(begin + count), outputs, 0, 0});
}

}  // namespace

const char* name_of(MlpArray array) {
  switch (array) {
    case MlpArray::weights:
      return "weights";
    case MlpArray::adam_m:
      return "adam_m";
    case MlpArray::adam_v:
      return "adam_v";
  }
  return "?";
}

std::vector<MlpParameter> mlp_parameters(const MlpShape& shape) {
  std::vector<MlpParameter> list;
  for (int l = 0; l < Mlp::layer_count; ++l) {
    const int in = l == 0 ? shape.inputs() : shape.width, out = l == Mlp::hidden_layers ? shape.outputs : shape.width;
    add_layer("layer" + std::to_string(l), {out, in}, in, out, list);
  }
  if (shape.encoder_particles == 0) return list;
  const std::vector<int64_t> lengths = ConvEncoder::lengths(shape.encoder_particles);
  constexpr int64_t channels = ConvEncoder::channels, kernel = ConvEncoder::kernel, hidden = ConvEncoder::hidden;
  for (std::size_t l = 0; l + 1 < lengths.size(); ++l)
    add_layer("encoder.conv" + std::to_string(l), {channels, channels, kernel}, channels * kernel, channels * kernel,
              list);
  add_layer("encoder.hidden", {hidden, channels * lengths.back()}, channels * lengths.back(), hidden, list);
  add_layer("encoder.latent", {shape.latents, hidden}, hidden, shape.latents, list);
  return list;
}

int64_t flat_size(const std::vector<MlpParameter>& parameters) {
  return parameters.empty() ? 0 : parameters.back().begin + parameters.back().count;
}

std::vector<float> xavier_values(const std::vector<MlpParameter>& parameters, const MlpShape& shape, uint64_t seed) {
  const Random random(seed, RandomPurpose::weight_init, static_cast<uint64_t>(shape.outputs));
  std::vector<float> values(static_cast<std::size_t>(flat_size(parameters)), 0.0f);
  for (const MlpParameter& p : parameters) {
    if (p.fan_in == 0) continue;
    const double bound = std::sqrt(6.0 / static_cast<double>(p.fan_in + p.fan_out));
    for (int64_t i = p.begin; i < p.begin + p.count; ++i)
      values[static_cast<std::size_t>(i)] =
          static_cast<float>(random.uniform(static_cast<uint64_t>(i), 0, -bound, bound));
  }
  return values;
}

}  // namespace graupel::train
