#include "rom/networks/conv_encoder.h"

#include <cmath>
#include <utility>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

std::string conv_name(const std::string& prefix, std::size_t layer) { return prefix + ".conv" + std::to_string(layer); }

double elu(double x) { return x > 0 ? x : std::expm1(x); }

std::vector<double> linear(const MlpLayer& layer, const std::vector<double>& x) {
  std::vector<double> y(layer.bias.begin(), layer.bias.end());
  for (int o = 0; o < layer.out; ++o)
    for (int i = 0; i < layer.in; ++i)
      y[static_cast<std::size_t>(o)] += static_cast<double>(layer.weight[static_cast<std::size_t>(o * layer.in + i)]) *
                                        x[static_cast<std::size_t>(i)];
  return y;
}

/// elu(conv x) of x [channels, length] -> [channels, places].
std::vector<double> convolve(const MlpLayer& layer, const std::vector<double>& x, int64_t length, int64_t places) {
  constexpr int channels = ConvEncoder::channels, kernel = ConvEncoder::kernel;
  std::vector<double> y(static_cast<std::size_t>(channels * places));
  for (int64_t i = 0; i < places; ++i)
    for (int o = 0; o < channels; ++o) {
      double sum = static_cast<double>(layer.bias[static_cast<std::size_t>(o)]);
      for (int c = 0; c < channels; ++c)
        for (int k = 0; k < kernel; ++k)
          sum += static_cast<double>(layer.weight[static_cast<std::size_t>((o * channels + c) * kernel + k)]) *
                 x[static_cast<std::size_t>(c * length + ConvEncoder::stride * i + k)];
      y[static_cast<std::size_t>(o * places + i)] = elu(sum);
    }
  return y;
}

}  // namespace

std::vector<int64_t> ConvEncoder::lengths(int64_t particles) {
  std::vector<int64_t> lengths = {particles};
  while (lengths.back() > longest) lengths.push_back((lengths.back() - kernel) / stride + 1);
  return lengths;
}

ConvEncoder::ConvEncoder(int64_t particles, std::vector<MlpLayer> convolutions, MlpLayer hidden_layer,
                         MlpLayer latent_layer, Standardization position)
    : lengths_(lengths(particles)),
      convolutions_(std::move(convolutions)),
      hidden_(std::move(hidden_layer)),
      latent_(std::move(latent_layer)),
      position_(rounded(position)) {
  GRAUPEL_ASSERT(convolutions_.size() + 1 == lengths_.size());
  GRAUPEL_ASSERT(hidden_.in == channels * lengths_.back() && hidden_.out == hidden && latent_.in == hidden);
}

std::vector<double> ConvEncoder::encode(const std::vector<double>& position) const {
  const int64_t n = particles();
  GRAUPEL_ASSERT(static_cast<int64_t>(position.size()) == channels * n);
  std::vector<double> x(position.size());
  for (int64_t p = 0; p < n; ++p)
    for (int64_t c = 0; c < channels; ++c) {
      const auto axis = static_cast<std::size_t>(c);
      x[static_cast<std::size_t>(c * n + p)] =
          (position[static_cast<std::size_t>(channels * p + c)] - position_.shift[axis]) * position_.scale[axis];
    }
  for (std::size_t l = 0; l < convolutions_.size(); ++l)
    x = convolve(convolutions_[l], x, lengths_[l], lengths_[l + 1]);
  x = linear(hidden_, x);
  for (double& value : x) value = elu(value);
  return linear(latent_, x);
}

ConvEncoder ConvEncoder::load(const nn::Weights& weights, const std::string& prefix, int64_t particles, int latents) {
  return load(weights, prefix, particles, latents, load_standardization(weights, prefix + ".position", channels));
}

ConvEncoder ConvEncoder::load(const nn::Weights& weights, const std::string& prefix, int64_t particles, int latents,
                              Standardization position) {
  const std::vector<int64_t> places = lengths(particles);
  std::vector<MlpLayer> convolutions;
  for (std::size_t l = 0; l + 1 < places.size(); ++l)
    convolutions.push_back(load_layer(weights, conv_name(prefix, l), {channels, channels, kernel}));
  MlpLayer hidden_layer = load_layer(weights, prefix + ".hidden", {hidden, channels * places.back()});
  MlpLayer latent_layer = load_layer(weights, prefix + ".latent", {latents, hidden});
  return {particles, std::move(convolutions), std::move(hidden_layer), std::move(latent_layer), std::move(position)};
}

void ConvEncoder::store(nn::Weights& weights, const std::string& prefix) const {
  for (std::size_t l = 0; l < convolutions_.size(); ++l)
    store_layer(weights, conv_name(prefix, l), convolutions_[l], {channels, channels, kernel});
  store_layer(weights, prefix + ".hidden", hidden_, {hidden, hidden_.in});
  store_layer(weights, prefix + ".latent", latent_, {latent_.out, hidden});
  store_standardization(weights, prefix + ".position", position_);
}

}  // namespace graupel::rom
