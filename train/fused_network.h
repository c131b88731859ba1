// Forward and backward pass of the hierarchical graph network on a GPU, by graph/cuda/row_layers.h: products in bf16
// with f32 sums, residual sums and weights in f32. What the backward pass can compute anew is not kept. The function is
// that of HgnNetwork. Latent width 128. Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/buffer.h"
#include "graph/cuda/row_layers.h"
#include "train/hgn_network.h"

namespace graupel::train {

class FusedNetwork {
 public:
  /// Whether the passes exist for such a network on such a device.
  static bool fits(const graph::HgnConfig& config, Device device);

  FusedNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
               const at::Tensor& gradient);

  /// Normalised accelerations [particles, 3]; keeps what backward() needs until the next call.
  at::Tensor forward(const DeviceBatch& batch);
  /// Writes the gradient of every weight; `grad` is the gradient of forward()'s result.
  void backward(const DeviceBatch& batch, const at::Tensor& grad);

 private:
  /// Latents of cells in both precisions.
  struct Latents {
    at::Tensor f32, f16;
  };
  struct Iteration {
    graph::RowNetwork edge, cell;
  };
  struct Block {
    std::string name;
    std::vector<Iteration> iterations;
  };

  void add_tiles(const std::string& name, const Fcn& fcn);
  const uint16_t* tile(const std::string& fcn, int64_t first_column) const;
  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }
  /// A network with its second layer; operands and tables are the caller's.
  graph::RowNetwork network(const std::string& name, int64_t rows) const;

  at::Tensor rows32(int64_t rows);
  at::Tensor rows16(int64_t rows);
  Latents latents(int64_t rows);
  /// [rows, columns] f32 as [rows, 128] bf16.
  at::Tensor packed(const at::Tensor& numbers);
  /// Corner bits of the pairs of `particles`, packed.
  const uint16_t* corner_rows(int64_t particles);

  Latents particle_to_grid(const DeviceBatch& batch);
  at::Tensor grid_to_particle(const DeviceBatch& batch, const Latents& cells);
  Latents pass_messages(Block& block, const DeviceLevel& level, const Latents& nodes);
  at::Tensor pass_messages_backward(Block& block, const DeviceLevel& level, at::Tensor grad);
  /// Goes back through `name` and adds the products for its W2, b2, gamma and beta.
  graph::RowNetworkGradient back_through(const std::string& name, graph::RowNetworkGradient gradient);
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
  at::Tensor corner_bits_, slot_vector_, octant_offset_;
  at::TensorOptions number_, half_;

  std::map<std::pair<std::string, int64_t>, int> tile_of_;
  std::vector<graph::TileSource> tile_sources_;
  Buffer<graph::TileSource> sources_on_device_;
  at::Tensor tiles_, corner_rows_;
  graph::WeightProducts products_;
  std::vector<at::Tensor> kept_;  ///< what launches of this step read and write
  std::vector<Sum> sums_;

  // Of the last forward pass
  at::Tensor input_;
  Latents particles_;
  graph::RowNetwork encoder_, to_grid_, to_particle_;
  std::vector<graph::RowNetwork> restriction_, prolongation_;
  std::vector<Block> down_, up_;
  FcnRecord decoder_;
  at::Tensor finest16_;  ///< latents of the level-0 cells after the up pass
};

}  // namespace graupel::train
