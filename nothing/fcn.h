// The FCN of the HGN paper (figure 4): y = LayerNorm(W2 leaky_relu(W1 x + b1) + b2), the normalisation optional. The
// networks of GNS may have further hidden layers between the first and the last.
// Its input is often a concatenation [a, b, ..], so W1 can be taken apart: W1 x = Wa a + Wb b + .., each part evaluated
// where it is cheapest (once per node, or once per table row instead of once per pair).
#pragma once

#include <string>
#include <vector>

#include "nn/linear.h"
#include "nn/rows.h"
#include "nn/weights.h"

namespace graupel::nn {

enum class Norm { none, layer };

/// Weights of one FCN as stored: `<prefix>.layer1.weight` [hidden, in], `.layer1.bias`, `.layer2.weight` [out, hidden],
/// `.layer2.bias`, and for Norm::layer `.norm.weight`, `.norm.bias` [out]. With n hidden layers, `.layer2` to
/// `.layer<n>` are [hidden, hidden] and `.layer<n + 1>` is the last one.
struct FcnWeights {
  struct Layer {
    std::vector<float> weight, bias;
  };
  int in = 0, hidden = 0, out = 0;
  std::vector<float> weight1, bias1;
  std::vector<Layer> middle;          ///< of further hidden layers
  std::vector<float> weight2, bias2;  ///< of the last layer
  std::vector<float> gamma, beta;

  /// Throws InputError for a tensor that is missing, of another shape or not finite. Without hidden layers it is a
  /// linear layer alone, `<prefix>.weight` [out, in] and `<prefix>.bias`, as the first layer of an FCN.
  static FcnWeights load(const Weights& weights, const std::string& prefix, int in, int hidden, int out,
                         Norm norm = Norm::layer, int hidden_layers = 1);

  enum class Bias { with, without };
  /// Columns [column, column + count) of the first layer.
  Linear first_layer_part(int column, int count, Bias bias) const;
  /// The first layer on an input of `parts` padded rows of `in / parts` columns, one behind the other.
  Linear first_layer_of_padded(int parts) const;
};

/// Several linear maps of one input, evaluated as one: outputs stand side by side, each padded to its own width.
class StackedLinear {
 public:
  StackedLinear() = default;
  struct Part {
    const FcnWeights* fcn;
    int column;  ///< first column of its first layer
    FcnWeights::Bias bias;
  };
  StackedLinear(int in, const std::vector<Part>& parts);
  const Linear& linear() const { return linear_; }
  int width() const { return linear_.width(); }

 private:
  Linear linear_;
};

/// Rows W1[:, column ..] x for a fixed set of values x of an input part (offsets between cells, embeddings);
/// [count][padded_width(hidden)].
class InputTable {
 public:
  InputTable() = default;
  InputTable(const FcnWeights& fcn, int column, const std::vector<std::vector<float>>& values);
  const float* row(int i) const { return rows_.data() + static_cast<int64_t>(i) * width_; }

 private:
  int width_ = 0;
  Buffer<float> rows_;
};

/// The hidden layers after the first one: h <- leaky_relu(W h + b) for each.
class MiddleLayers {
 public:
  MiddleLayers() = default;
  MiddleLayers(const FcnWeights& fcn, float slope);

  /// `hidden` holds activated rows of padded_width(hidden) columns, `spare` has room for as many. Returns the one of
  /// the two that holds the result.
  float* apply(float* hidden, float* spare, int64_t rows) const;

 private:
  float slope_ = leaky_slope;
  std::vector<Linear> layers_;
};

/// Last layer with its layer normalisation. Subtracting the mean is linear, so it is folded into W2 and b2; a row
/// then is  scale * y * gamma + beta  with  scale = 1 / sqrt(mean(y^2) + eps).
class NormalizedLayer {
 public:
  NormalizedLayer() = default;
  explicit NormalizedLayer(const FcnWeights& fcn);

  int width() const { return linear_.width(); }
  const Linear& linear() const { return linear_; }
  /// y = W2' leaky(hidden) + b2', rows of width() columns.
  void apply(const float* hidden, int64_t rows, float* y) const {
    linear_.apply(hidden, width_in_, rows, y, linear_.width());
  }
  /// scale of a row that apply made.
  float scale(const float* y) const {
    return layer_norm_scale(sum_of_squares(y, linear_.width()) * (1.0f / static_cast<float>(linear_.out())));
  }
  /// out = scale * y * gamma + beta; out may be y.
  void finish(float* out, const float* y) const { finish(out, y, scale(y)); }
  void finish(float* out, const float* y, float scale_of_y) const {
    row_kernels().normalize(out, scale_of_y, y, gamma(), beta(), false, width());
  }
  void finish(float* y) const { finish(y, y); }
  /// sum += scale * y * gamma + beta, where the scale is known, too.
  void add_to(float* sum, const float* y, float scale_of_y) const {
    row_kernels().normalize(sum, scale_of_y, y, gamma(), beta(), true, width());
  }
  void add_to(float* sum, const float* y) const { add_to(sum, y, scale(y)); }
  const float* gamma() const { return gamma_.data(); }
  const float* beta() const { return beta_.data(); }

 private:
  int width_in_ = 0;
  Linear linear_;
  Buffer<float> gamma_, beta_;  ///< [width], zero in the padding
};

}  // namespace graupel::nn
