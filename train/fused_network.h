// Forward and backward pass of the hierarchical graph network on a GPU, by graph/cuda/row_layers.h: products in bf16
// with f32 sums, residual sums and weights in f32. What the backward pass can compute anew is not kept. The function is
// that of HgnNetwork. Latent width 128. Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "graph/cuda/hgn_passes.h"
#include "train/hgn_network.h"

namespace graupel::train {

class FusedNetwork : private graph::RowMemory {
 public:
  /// Whether the passes exist for such a network on such a device.
  static bool fits(const graph::HgnConfig& config, Device device);

  FusedNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
               const at::Tensor& gradient);

  /// Normalised accelerations [particles, 3 k]; keeps what backward() needs until the next call.
  at::Tensor forward(const DeviceBatch& batch);
  /// Writes the gradient of every weight; `grad` is the gradient of forward()'s result.
  void backward(const DeviceBatch& batch, const at::Tensor& grad);

 private:
  float* rows32(int64_t rows) override;
  uint16_t* rows16(int64_t rows) override;
  bool keeps_all() const override { return true; }

  /// [rows, columns] f32 as [rows, 128] bf16.
  const uint16_t* packed(const at::Tensor& numbers);
  /// Corner bits of the pairs of `particles`, packed.
  const uint16_t* corner_rows(int64_t particles);
  graph::HgnGraph graph_of(const DeviceBatch& batch);
  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }

  /// Goes back through `name` and adds the products for its W2, b2, gamma and beta.
  graph::RowNetworkGradient back_through(const std::string& name, graph::RowNetworkGradient gradient);
  float* pass_messages_backward(const std::string& block, const graph::HgnRecord::Block& record,
                                const DeviceLevel& level, float* grad);
  /// Gradient of columns of W1: sum over rows of d x, `bias` the sum of d.
  void add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const at::Tensor& w1_grad, int64_t first_column,
                   int64_t columns, const at::Tensor& bias = {});
  /// What pairs leave to their particles: weights of the particle's and the offset's part, and grad_particles.
  void pairs_to_particles(const DeviceBatch& batch, const std::string& name, const graph::RowNetworkGradient& pairs,
                          int64_t particle_column, float offset_sign, at::Tensor& grad_particles);

  /// A gradient that two products make up.
  struct Sum {
    at::Tensor to, a, b;
  };

  graph::HgnConfig config_;
  std::map<std::string, Fcn> fcns_;
  at::Tensor embedding_, embedding_grad_;
  at::TensorOptions number_, half_;
  graph::PackedHgn packed_;
  graph::WeightProducts products_;
  at::Tensor corner_rows_;
  std::vector<at::Tensor> kept_;  ///< what launches of this step read and write
  std::vector<Sum> sums_;
  graph::HgnRecord record_;
  FcnRecord decoder_;
};

}  // namespace graupel::train
