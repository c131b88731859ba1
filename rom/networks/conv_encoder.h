// The paper's encoder (NSF section 4.2): positions of all particles, in their fixed order, to the latent. Strided
// convolutions over the list of particles until no more than 12 places are left, then two linear layers,
//   e(x) = L2 elu(L1 elu(conv .. elu(conv (x - shift) scale))).
// The paper's ELU after L2 is left out: it would keep latents above -1, which Gauss-Newton does not know.
#pragma once

#include <string>
#include <vector>

#include "rom/networks/mlp.h"

namespace graupel::rom {

class ConvEncoder {
 public:
  static constexpr int channels = 3, kernel = 6, stride = 4, longest = 12, hidden = 32;
  /// Places before the first and after every convolution; the first is the number of particles.
  static std::vector<int64_t> lengths(int64_t particles);

  /// `convolutions`: in = channels * kernel (kernel fastest), out = channels; as many as lengths() asks for.
  ConvEncoder(int64_t particles, std::vector<MlpLayer> convolutions, MlpLayer hidden_layer, MlpLayer latent_layer,
              Standardization position);

  int latents() const { return latent_.out; }
  int64_t particles() const { return lengths_.front(); }
  /// The latent of positions [particles, 3] [m].
  std::vector<double> encode(const std::vector<double>& position) const;

  /// Tensors <prefix>.conv0.weight [3, 3, 6], .conv0.bias [3] .., .hidden.weight [32, 3 length], .latent.weight [r, 32]
  /// with their biases, .position.shift and .scale [3]. Throws InputError as nn::Weights::get.
  static ConvEncoder load(const nn::Weights& weights, const std::string& prefix, int64_t particles, int latents);
  /// The same with another standardization than the file's.
  static ConvEncoder load(const nn::Weights& weights, const std::string& prefix, int64_t particles, int latents,
                          Standardization position);
  void store(nn::Weights& weights, const std::string& prefix) const;

 private:
  std::vector<int64_t> lengths_;
  std::vector<MlpLayer> convolutions_;
  MlpLayer hidden_, latent_;
  Standardization position_;
};

}  // namespace graupel::rom
