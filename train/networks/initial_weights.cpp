#include "train/networks/initial_weights.h"

#include <algorithm>
#include <map>

#include "core/system/error.h"

namespace graupel::train {
namespace {

using Metadata = std::map<std::string, std::string>;

/// "key: a, here b" of the first entry that differs.
std::string first_difference(const Metadata& a, const Metadata& b) {
  for (const auto& [key, value] : a)
    if (const auto other = b.find(key); other == b.end() || other->second != value)
      return key + ": " + value + ", here " + (other == b.end() ? "none" : other->second);
  return "";
}

/// Of a network of one frame at once, but for that of these settings.
Metadata metadata_but_bundle(NetworkConfig config) {
  std::visit([](auto& c) { c.bundle = 1; }, config);
  return metadata_of(config);
}

int64_t latent_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) { return c.latent; }, config);
}

/// "decoder.layer2." with one hidden layer.
std::string last_layer_of_decoder(const nn::Weights& weights) {
  const auto layer = [](int number) { return "decoder.layer" + std::to_string(number) + "."; };
  int number = 2;
  while (weights.tensors.contains(layer(number + 1) + "weight")) ++number;
  return layer(number);
}

/// Rows of [3 k_theirs, ...] for [3 k_ours, ...]: three a frame, those of the last one again for further frames.
nn::Tensor rows_of_frames(const nn::Tensor& theirs, int64_t their_bundle, int64_t our_bundle) {
  nn::Tensor ours{.dtype = theirs.dtype, .shape = theirs.shape, .bytes = {}};
  ours.shape[0] = 3 * our_bundle;
  const auto frame_bytes = static_cast<std::ptrdiff_t>(theirs.bytes.size()) / their_bundle;
  for (int64_t frame = 0; frame < our_bundle; ++frame) {
    const auto from = theirs.bytes.begin() + frame_bytes * std::min(frame, their_bundle - 1);
    ours.bytes.insert(ours.bytes.end(), from, from + frame_bytes);
  }
  return ours;
}

}  // namespace

nn::Weights starting_weights(const std::string& file, const NetworkConfig& config) {
  nn::Weights weights = nn::read_safetensors(file);
  const NetworkConfig file_config = network_config_of(weights);
  const Metadata theirs = metadata_but_bundle(file_config), ours = metadata_but_bundle(config);
  if (theirs != ours)
    throw ConfigError("'" + file + "' is a network with other settings than this run's (" +
                      first_difference(theirs, ours) + "). Give this run the file's, with --set");
  const int64_t bundle = features_of(file_config).bundle, latent = latent_of(file_config);
  if (bundle == features_of(config).bundle) return weights;
  const std::string last = last_layer_of_decoder(weights);
  weights.get(last + "weight", {3 * bundle, latent});
  weights.get(last + "bias", {3 * bundle});
  for (const char* name : {"weight", "bias"}) {
    nn::Tensor& tensor = weights.tensors.at(last + name);
    tensor = rows_of_frames(tensor, bundle, features_of(config).bundle);
  }
  return weights;
}

}  // namespace graupel::train
