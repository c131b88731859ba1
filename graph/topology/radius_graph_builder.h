// The graph of GNS for a batch of scenes (graph/topology/gns_graph.h, sparsegrid/radius_graph.h), built where its
// network runs: by cells of the radius's size, with the obstacle particles that are in the receptive field. Particles
// keep their order, scene by scene; obstacle particles stand behind those of all scenes, as in train::Batch. The same
// numbers on every device.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/config/gns_config.h"
#include "graph/topology/device_lists.h"
#include "graph/topology/radius_kernels.h"

namespace graupel::graph {

/// One scene of the graph. Pointers are to the device's memory and must stay valid until the next prepare().
struct RadiusScene {
  Vec3d low, high;               ///< [m] box that holds the particles, turned, give or take; what is outside costs time
  int64_t particles = 0;         ///< scenes follow each other
  const Vec3f* point = nullptr;  ///< [points] of obstacles, unturned
  int64_t points = 0;
  AxisMap symmetry = {};
  EnvironmentView environment = {};  ///< for the features of obstacle particles
};

/// Arrays in the device's memory. Edges are sorted by receiver, then by sender.
struct RadiusLinks {
  const int32_t *node_count, *obstacle_count, *edge_count;  ///< all 0 where the edges exceed the capacity
  const int32_t* begin;                                     ///< [nodes + 1] edges of a receiver
  const int32_t *sender, *receiver;                         ///< [edges]
  const int32_t* reverse;                                   ///< [edges] the edge from receiver to sender
  const float* features;                                    ///< [edges, edge_feature_count]
  const int32_t* fault;                                     ///< 1 where the edges exceed the capacity
};

/// Counts of one build, on the host.
struct RadiusCounts {
  int64_t nodes = 0, edges = 0;
};

class RadiusGraphBuilder {
 public:
  RadiusGraphBuilder(Device device, const GnsConfig& config)
      : RadiusGraphBuilder(device, config.radius, config.receptive_field()) {}
  /// `receptive_field`: how near obstacle particles must be [m].
  RadiusGraphBuilder(Device device, double radius, double receptive_field);
  ~RadiusGraphBuilder();
  RadiusGraphBuilder(RadiusGraphBuilder&&) noexcept;

  /// Cells and memory for these scenes. Throws ConfigError when their boxes have more than 2^26 cells.
  void prepare(const std::vector<RadiusScene>& scenes, void* stream = nullptr);
  /// Particles, and all obstacle points.
  int64_t most_nodes() const { return particles_ + points_; }

  /// The graph of `position` [most_nodes()], of which the particles' are given and those of obstacle particles are
  /// written; launches alone.
  void build(Vec3f* position, void* stream = nullptr);
  /// Features [most_nodes(), rules.width] and types [most_nodes()] of the obstacle particles chosen last.
  void describe_obstacles(const FeatureRules& rules, float* features, int32_t* type_row, void* stream = nullptr);
  /// Waits for the last build; where its edges found no room, makes some, `spare` of it for later builds, and
  /// builds them. Throws InputError for 2^31 edges or more.
  RadiusCounts finish(double spare, void* stream = nullptr);
  /// Most edges of a build.
  int64_t capacity() const { return capacity_; }
  RadiusLinks links() const;

 private:
  struct Arrays;
  void list_cells(int64_t nodes, const radius::GraphCounts* counts, void* stream);
  void link_pairs(void* stream);
  radius::Points points() const;
  radius::CellOrder order() const;
  radius::RowSearch search() const;
  template <typename Body>
  void launch(void* stream, int64_t n, const Body& body) const;

  Device device_;
  double radius_, receptive_field_, cell_size_;
  int64_t particles_ = 0, points_ = 0, capacity_ = 0;
  int scenes_ = 0;
  int32_t cells_ = 0;
  Vec3f* position_ = nullptr;  ///< of the last build
  std::unique_ptr<Arrays> arrays_;
};

}  // namespace graupel::graph
