// A graph network on a GPU, layer by layer: the weights of its plan (graph/plan/layer_plan.h) as the kernels of
// row_layers.h take them, the links of a batch, and the memory of a pass. Products are in bf16. First layers over
// [f_i, f_j, e] are evaluated as W_i f_i + W_j f_j + W_e e, projected once a node.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/cuda/fused_mlp/row_layers.h"
#include "graph/plan/layer_plan.h"
#include "graph/topology/level_graph.h"

namespace graupel::graph {

/// Weights of one layer of a plan, f32, in the GPU's memory; w1 [outputs of layer 1, inputs]. Of a linear layer w1 and
/// b1 alone.
struct DeviceFcn {
  const float *w1 = nullptr, *b1 = nullptr, *w2 = nullptr, *b2 = nullptr, *gamma = nullptr, *beta = nullptr;
  int32_t inputs = 0;
  float slope = 0;  ///< of the activation below zero
};

/// The offsets of a gather's links: sign times one of the few that there are.
struct LinkOffsets {
  Offsets kind;
  float sign;
};
LinkOffsets offsets_of(LinkKind links);

/// The weights as the kernels take them: bf16 tiles of every matrix, and what first layers add for the few offsets that
/// corners, octants, neighbour slots and particle types have.
class PackedNetwork {
 public:
  /// Whether the kernels exist for such a network: width 128, one hidden layer, at most 128 inputs.
  static bool fits(const LayerPlan& plan);

  /// Where a tensor of the plan lies in the GPU's memory; the pointers must stay valid.
  using Parameters = std::function<const float*(const std::string& name)>;
  PackedNetwork(LayerPlan plan, const Parameters& parameter);

  /// Takes over the weights' present values.
  void refresh(void* stream);

  const LayerPlan& plan() const { return plan_; }
  const DeviceFcn& fcn(const std::string& name) const { return fcns_.at(name); }
  /// Tile of 128 columns of a first layer.
  const uint16_t* tile(const std::string& fcn, int64_t first_column) const;
  /// Rows that first layers add: of the encoder by type; of gathers by corner, octant or slot.
  const float* table(const std::string& fcn) const;
  /// A network over rows with its second layer; operands and tables are the caller's.
  FusedMlp network(const std::string& fcn, int64_t rows, const int32_t* row_count = nullptr) const;
  /// The decoder with its weights; rows, inputs and results are the caller's.
  Decoder decoder() const;

 private:
  void add_tables(const float* embedding);

  LayerPlan plan_;
  std::map<std::string, DeviceFcn> fcns_;
  std::map<std::pair<std::string, int64_t>, int64_t> tile_of_;
  std::map<std::string, int64_t> table_of_;
  Buffer<TileSource> tile_sources_{Device::cuda, 0};
  Buffer<OffsetTable> table_sources_{Device::cuda, 0};
  Buffer<uint16_t> tiles_{Device::cuda, 0};
  Buffer<float> tables_{Device::cuda, 0};
};

/// Particles, pairs and levels of a batch of scenes (train::Batch, GridLinks) in the GPU's memory. Without a grid there
/// are no pairs, and the one level has the links between particles, obstacle particles behind the others.
struct NetworkGraph {
  int64_t particles = 0;
  const int32_t *particle_count = nullptr, *pair_count = nullptr;  ///< row_layers.h
  const float* features = nullptr;                                 ///< [particles, width of the plan's first value]
  const int32_t* type_row = nullptr;                               ///< [particles]
  const float *weight = nullptr, *offset = nullptr;
  const int32_t *cell = nullptr, *pair_begin = nullptr, *pair = nullptr;
  std::vector<LevelLinks> level;
  const float* edge_features = nullptr;  ///< [edges, 4] between particles
};

/// Where the passes put their rows of 128 numbers.
class RowMemory {
 public:
  virtual ~RowMemory() = default;
  virtual float* rows32(int64_t rows) = 0;
  virtual uint16_t* rows16(int64_t rows) = 0;
  /// Whether every row is read after the pass; else those of an iteration may take the place of older ones.
  virtual bool keeps_all() const = 0;
};

/// Latents in both precisions.
struct RowLatents {
  float* f32 = nullptr;
  uint16_t* f16 = nullptr;
};

}  // namespace graupel::graph
