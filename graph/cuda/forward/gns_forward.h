// The graph network simulator on a GPU (GNS, graph/cpu/messages/gns_processor.h) by the kernels of row_layers.h, with
// products in bf16: one forward pass for rollouts and for training. First layers over [f_s, f_r, e] are evaluated as
// W_s f_s + W_r f_r + W_e e, projected once a node. Edge latents are bf16, the latents of nodes f32.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "graph/config/gns_config.h"
#include "graph/cuda/forward/packed_hgn.h"

namespace graupel::graph {

/// The weights as the kernels take them.
class PackedGns {
 public:
  /// Whether the kernels exist for such a network: width 128, one hidden layer, at most 128 inputs.
  static bool fits(const GnsConfig& config);

  /// `embedding` [types, E]; all pointers must stay valid.
  PackedGns(const GnsConfig& config, std::map<std::string, DeviceFcn> fcns, const float* embedding);
  /// Takes over the weights' present values.
  void refresh(void* stream);

  const GnsConfig& config() const { return config_; }
  const DeviceFcn& fcn(const std::string& name) const { return fcns_.at(name); }
  /// Tile of 128 columns of a first layer.
  const uint16_t* tile(const std::string& fcn, int64_t first_column) const;
  /// What the node encoder's first layer adds for a type.
  const float* type_table() const { return table_.data(); }
  /// A network over rows with its second layer; operands and tables are the caller's.
  FusedMlp network(const std::string& fcn, int64_t rows, const int32_t* row_count) const;

 private:
  GnsConfig config_;
  std::map<std::string, DeviceFcn> fcns_;
  std::map<std::pair<std::string, int64_t>, int64_t> tile_of_;
  Buffer<TileSource> tile_sources_{Device::cuda, 0};
  Buffer<OffsetTable> table_source_{Device::cuda, 0};
  Buffer<uint16_t> tiles_{Device::cuda, 0};
  Buffer<float> table_{Device::cuda, 0};
};

/// Particles, obstacle particles behind them, and edges by receiver, in the GPU's memory.
struct GnsRows {
  int64_t nodes = 0, edges = 0;
  const int32_t *node_count = nullptr, *edge_count = nullptr;  ///< row_layers.h
  const float* features = nullptr;                             ///< [nodes, input_width - embedding]
  const int32_t* type_row = nullptr;                           ///< [nodes]
  const int32_t *begin = nullptr, *sender = nullptr, *receiver = nullptr;
  const float* edge_features = nullptr;  ///< [edges, 4]
};

/// Where the latents of the edges lie, [edges, 128] each.
class EdgeMemory {
 public:
  virtual ~EdgeMemory() = default;
  /// e before step k. A step's may be that of the step before: it is written where it was read.
  virtual uint16_t* latent(int64_t k) = 0;
  /// The messages of a step.
  virtual uint16_t* message() = 0;
};

/// What a forward pass leaves for the backward pass.
struct GnsRecord {
  struct Step {
    FusedMlp edge;  ///< operand 0: e
    FusedMlp node;  ///< operands: the sums of messages, f
  };
  FusedMlp node_encoder, edge_encoder;
  std::vector<Step> step;
};

/// "step.<k>.part"
std::string step_name(int64_t k, const char* part);

/// Latents of the nodes before the decoder, [nodes, 128].
float* forward_to_decoder(const PackedGns& network, const GnsRows& rows, RowMemory& memory, EdgeMemory& edges,
                          GnsRecord& record, void* stream);

}  // namespace graupel::graph
