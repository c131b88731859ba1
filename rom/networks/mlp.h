// Multilayer perceptrons of reduced-order fields (NSF appendix B): five hidden layers of one width, ELU between them,
//   y = shift' + scale' (W5 elu(W4 .. elu(W0 (z - shift) scale + b0) .. + b4) + b5),   z = (X, q[, mu]).
// Derivatives with respect to all inputs, X and q alike, by one reverse pass: a field has 3 to 9 outputs but 3 + r
// inputs and more, and the deformation, whose derivatives every step needs, has the fewest outputs.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "nn/weights.h"
#include "rom/networks/standardization.h"

namespace graupel::rom {

/// y = x W^T + b.
struct MlpLayer {
  int in = 0, out = 0;
  std::vector<float> weight;  ///< [out, in]
  std::vector<float> bias;    ///< [out]
};

/// Tensors <name>.weight of `shape`, its first extent the outputs, and <name>.bias. Throws InputError as
/// nn::Weights::get.
MlpLayer load_layer(const nn::Weights& weights, const std::string& name, const std::vector<int64_t>& shape);
void store_layer(nn::Weights& weights, const std::string& name, const MlpLayer& layer, std::vector<int64_t> shape);

class Mlp {
 public:
  static constexpr int hidden_layers = 5, layer_count = hidden_layers + 1;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  Mlp() = default;
  /// `layers`: layer_count of them, the hidden ones of one width.
  Mlp(std::vector<MlpLayer> layers, Standardization input, Standardization output);

  int inputs() const { return layers_.front().in; }
  int width() const { return layers_.front().out; }
  int outputs() const { return layers_.back().out; }
  const std::vector<MlpLayer>& layers() const { return layers_; }
  const Standardization& input() const { return input_; }
  const Standardization& output() const { return output_; }

  /// y of rows z [n, inputs] -> [n, outputs], in f64, on the calling thread.
  void evaluate(const Rows& z, Rows& y) const;
  /// The same and dy/dz, row n * outputs + c holding output c of row n, [n outputs, inputs].
  void evaluate(const Rows& z, Rows& y, Rows& jacobian) const;
  /// y of one row z [1, inputs] and dy/dz_j for its first `wrt` inputs, [wrt, outputs], by one forward pass: for
  /// networks of more outputs than that.
  void tangents(const Rows& z, int wrt, Rows& y, Rows& slopes) const;

  /// Tensors <prefix>.layer0.weight [width, inputs], .layer0.bias [width] .. .layer5, .input.shift, .input.scale
  /// [inputs], .output.shift, .output.scale [outputs]. Throws InputError as nn::Weights::get, and for a scale of 0.
  static Mlp load(const nn::Weights& weights, const std::string& prefix, int inputs, int outputs);
  /// The layers alone, from tensors whose names begin with `prefix`.
  static std::vector<MlpLayer> load_layers(const nn::Weights& weights, const std::string& prefix, int inputs, int width,
                                           int outputs);
  void store(nn::Weights& weights, const std::string& prefix) const;

 private:
  /// evaluate(), and elu' at every hidden unit where it is asked for.
  void forward(const Rows& z, Rows& y, std::vector<Rows>* slope) const;

  std::vector<MlpLayer> layers_;
  std::vector<Rows> weight_;  ///< of layers_, in f64
  std::vector<Eigen::RowVectorXd> bias_;
  Standardization input_, output_;
};

/// Inputs of tensor <prefix>.layer0.weight. Throws InputError when it is not there.
int mlp_inputs(const nn::Weights& weights, const std::string& prefix);

}  // namespace graupel::rom
