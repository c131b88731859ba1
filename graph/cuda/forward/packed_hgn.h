// The hierarchical graph network (HGN paper, figure 2) on a GPU, layer by layer: its weights as the kernels of
// row_layers.h take them, the links of a batch, and the steps that both of its forms have in common. Products are in
// bf16. First layers over [f_i, f_j, e] are evaluated as W_i f_i + W_j f_j + W_e e, projected once a cell.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/config/hgn_config.h"
#include "graph/cuda/fused_mlp/row_layers.h"
#include "graph/plan/layer_plan.h"
#include "graph/topology/level_graph.h"

namespace graupel::graph {

/// Weights of one FCN, f32, in the GPU's memory; w1 [outputs of layer 1, inputs]. Of a gather layer w1, b1 and inputs
/// alone.
struct DeviceFcn {
  const float *w1 = nullptr, *b1 = nullptr, *w2 = nullptr, *b2 = nullptr, *gamma = nullptr, *beta = nullptr;
  int32_t inputs = 0;
};

/// The weights as the kernels take them: bf16 tiles of every matrix, and what first layers add for the few offsets that
/// corners, octants, neighbour slots and particle types have.
class PackedHgn {
 public:
  /// Whether the kernels exist for such a network: width 128, at most 128 inputs.
  static bool fits(const HgnConfig& config);

  /// `embedding` [types, E]; all pointers must stay valid.
  PackedHgn(const HgnConfig& config, std::map<std::string, DeviceFcn> fcns, const float* embedding);

  /// Takes over the weights' present values.
  void refresh(void* stream);

  const HgnConfig& config() const { return config_; }
  const LayerPlan& plan() const { return plan_; }
  const DeviceFcn& fcn(const std::string& name) const { return fcns_.at(name); }
  /// Tile of 128 columns of a first layer.
  const uint16_t* tile(const std::string& fcn, int64_t first_column) const;
  /// Rows that first layers add: of "encoder" by type; of the transfers by corner or octant; of first edges by slot.
  const float* table(const std::string& fcn) const;
  /// A network over rows with its second layer; operands and tables are the caller's.
  FusedMlp network(const std::string& fcn, int64_t rows, const int32_t* row_count = nullptr) const;

 private:
  void add_tables();

  HgnConfig config_;
  LayerPlan plan_;
  std::map<std::string, DeviceFcn> fcns_;
  const float* embedding_;
  std::map<std::pair<std::string, int64_t>, int64_t> tile_of_;
  std::map<std::string, int64_t> table_of_;
  std::vector<OffsetTable> table_sources_;
  Buffer<TileSource> tile_sources_;
  Buffer<OffsetTable> tables_on_device_;
  Buffer<uint16_t> tiles_;
  Buffer<float> tables_;
};

/// Particles, pairs and levels of a batch of scenes (train::Batch, GridLinks) in the GPU's memory.
struct HgnGraph {
  int64_t particles = 0;
  const int32_t *particle_count = nullptr, *pair_count = nullptr;  ///< row_layers.h
  const float* features;                                           ///< [particles, input_width - embedding]
  const int32_t* type_row;                                         ///< [particles]
  const float *weight, *offset;
  const int32_t *cell, *pair_begin, *pair;
  std::vector<LevelLinks> level;
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

/// "block.k.part"
inline std::string numbered(const std::string& block, int64_t k, const char* part = "") {
  return std::string(block).append(".").append(std::to_string(k)).append(part);
}

/// Latents of the particles after the encoder; launches it.
RowLatents encode_particles(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, FusedMlp& encoder,
                            void* stream);
/// The network of prolong.<l> that makes `refined` of the cells of level l + 1 and of level l, the links of `level`.
FusedMlp prolongation(const PackedHgn& network, std::size_t l, const LevelLinks& level, const RowLatents& coarse,
                      const RowLatents& fine, const RowLatents& refined);

}  // namespace graupel::graph
