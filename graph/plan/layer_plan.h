// A graph network as data: its layers, and the operations between the rows of a batch (particles, cells of the levels,
// links). HGN in both forms and GNS are such plans (plan_of); engines execute them. Names and shapes of the weights,
// initial values and operation counts are loops over a plan.
//
// One evaluation runs the operations in order; each writes one new value.
//   encode     h = FCN([features, embedding of the particle's type])            rows of particles
//   gather     m_l = layer([sources of link l, offset of l]) (+ residual)       a row a link
//   aggregate  s_r = scale * sum over the links l of receiver r of weight_l m_l
//   update     h = FCN([sources]) (+ residual)
//   add        h = a + b
//   decode     FCN without a norm, of the particles that move
// Restriction is a gather over the links from cells to their parents and an aggregate; prolongation a gather over the
// links from parents, of which each cell has one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "graph/config/network_config.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

/// Slope of HGN's LeakyReLU below zero.
inline constexpr double hgn_leaky_slope = 0.01;

/// Which rows a value has.
enum class RowSet {
  particles,  ///< those of obstacles included
  moving,     ///< the particles whose acceleration is asked for: the first ones
  cells,      ///< of a level
  pairs,      ///< eight a particle: the cells of level 0 around it
  edges       ///< links between neighbouring cells of a level, or between particles
};
struct Rows {
  RowSet set = RowSet::particles;
  int level = 0;
  bool operator==(const Rows&) const = default;
};

enum class LinkKind {
  particle_to_cell,  ///< offset (centre - x) / R, weight trilinear
  cell_to_particle,  ///< offset (x - centre) / R, weight trilinear
  cell_neighbors,    ///< of a level; offset: unit vector from sender to receiver
  particle_neighbors,
  to_parent,   ///< of a level's cells; offset (parent's centre - centre) / spacing
  from_parent  ///< to a level's cells, one a cell; offset the negative one
};
struct Links {
  LinkKind kind = LinkKind::cell_neighbors;
  int level = 0;
  bool operator==(const Links&) const = default;

  Rows sender() const;
  Rows receiver() const;
  Rows rows() const;       ///< of the links themselves
  int64_t offset() const;  ///< numbers of a link's offset
};

/// A fully connected network, or with hidden_layers = 0 one linear layer in front of an activation.
struct PlanLayer {
  std::string name;  ///< "down.0.1.edge"
  int64_t inputs = 0, hidden = 0, outputs = 0;
  int64_t hidden_layers = 1;
  double slope = hgn_leaky_slope;  ///< of the activation
  bool norm = true;                ///< layer norm of the outputs

  bool is_linear() const { return hidden_layers == 0; }
  int64_t first_width() const { return is_linear() ? outputs : hidden; }  ///< outputs of the first matrix
  int64_t products_behind_first() const;                                  ///< multiply-adds a row of the other matrices
};

/// At which end of a link a source is read.
enum class End { sender, receiver, link };
struct PlanSource {
  int value = 0;
  End end = End::link;  ///< of gathers; else the rows are the operation's own
};

namespace operation {
inline constexpr const char* encode = "encode";
inline constexpr const char* gather = "gather";
inline constexpr const char* aggregate = "aggregate";
inline constexpr const char* update = "update";
inline constexpr const char* add = "add";
inline constexpr const char* decode = "decode";
}  // namespace operation

struct PlanOperation {
  std::string kind;  ///< of namespace operation, or one that an engine was taught
  int layer = -1;    ///< index into layers; -1: none
  Links links = {};  ///< of gather and aggregate
  std::vector<PlanSource> sources = {};
  bool offset = false;  ///< the links' offset is the last input
  double scale = 1;
  int residual = -1;  ///< value that is added to the result
  int output = 0;
};

struct PlanValue {
  Rows rows;
  int64_t width = 0;
};

struct PlanTensor {
  std::string name;  ///< "down.0.1.edge.layer1.weight"
  std::vector<int64_t> shape;
  int64_t fan_in = 0;  ///< inputs of the linear layer it belongs to; 0 for norms and the embedding
};

/// Gathers over links of one kind and level that stand behind each other, with what is made of each: an iteration of
/// message passing or a transfer. Tuned engines run a plan block by block (plan_walk.h).
struct PlanBlock {
  std::string name;  ///< prefix of its layers: "down.0", "restrict.0"
  Links links;
  int64_t iterations = 1;     ///< gathers
  std::size_t operation = 0;  ///< first operation
  std::size_t number = 0;     ///< place in LayerPlan::blocks

  std::size_t level() const { return static_cast<std::size_t>(links.level); }
};

struct LayerPlan {
  std::string name;               ///< of the architecture
  int64_t embedding = 0;          ///< width of a type's row in the embedding table
  std::vector<PlanLayer> layers;  ///< in the order of their tensors
  std::vector<PlanValue> values;  ///< the first `inputs` are given: particle features, then features of edges
  int inputs = 1;
  std::vector<PlanOperation> operations;
  std::vector<std::size_t> stages;  ///< operations at which message-passing iterations begin: places for checkpoints
  std::vector<PlanBlock> blocks;    ///< empty, or all gathers in their order

  /// Throws ConfigError naming the operation and layer where rows, widths or order do not fit.
  void check() const;
  /// All weights: the embedding table, then layer by layer.
  std::vector<PlanTensor> tensors() const;

  const PlanBlock& block_of(const Links& links) const;
  /// Layers of a block's operations in their order; of the last block, those of the decoder too.
  std::vector<PlanLayer> layers_of(const PlanBlock& block) const;
  /// Factor on a block's first sum.
  double scale_of(const PlanBlock& block) const;
  int levels() const;  ///< of the grid hierarchy
};

/// Throws ConfigError where the plan has an operation that `engine` does not know, naming both.
void check_operations(const LayerPlan& plan, const std::string& engine, const std::vector<std::string>& known);

LayerPlan plan_of(const HgnConfig& config);
LayerPlan plan_of(const GnsConfig& config);
inline LayerPlan plan_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) { return plan_of(c); }, config);
}

/// Rows of one evaluation.
struct PlanRows {
  struct Level {
    int64_t cells = 0, edges = 0;
  };
  int64_t particles = 0, moving = 0;
  std::vector<Level> level;  ///< finest first; of GNS one, whose edges link particles

  int64_t count(const Rows& rows) const;
};

/// "cells" + `level` + "0".
std::string text_of(const Rows& rows, const std::string& level = " of level ");

PlanRows rows_of(const sparsegrid::Hierarchy<3>& hierarchy);

/// How first layers over concatenated inputs [f_i, f_j, e] are evaluated. Both give the same network.
enum class FirstLayers {
  whole,  ///< as the papers write them: all of the input, once a pair or an edge
  split   ///< the parts of f_i and f_j once a node; those of offsets, directions and embeddings, taken from tables or
          ///< added once a particle, are not counted
};
inline const char* name_of(FirstLayers first_layers) { return first_layers == FirstLayers::whole ? "whole" : "split"; }

/// Floating-point operations of one evaluation (a frame, or FeatureConfig::bundle of them): those of its matrix
/// products, a multiply-add counted as two. Biases, activations, norms and sums are not counted; they are some percent.
double flop_of(const LayerPlan& plan, const PlanRows& rows, FirstLayers first_layers = FirstLayers::split);

}  // namespace graupel::graph
