// Kernels of the radius graph builder (graph/topology/radius_graph_builder.cpp), for host and device: points by cells,
// obstacle points in the receptive field, pairs within the radius.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>

#include "core/math/axis_map.h"
#include "core/math/vec.h"
#include "core/parallel/host_device.h"
#include "graph/features/feature_row.h"
#include "graph/topology/gns_graph.h"

namespace graupel::graph::radius {

/// Cells of one scene. What lies outside the box counts to the nearest cell of it: cells of points within the radius
/// stay neighbours.
struct CellBox {
  Vec3i low, size;
  int32_t first_cell;  ///< of all scenes' cells

  GRAUPEL_HD int32_t row_of(int y, int z) const { return first_cell + (z * size[1] + y) * size[0]; }
  GRAUPEL_HD bool has_row(int y, int z) const { return y >= 0 && y < size[1] && z >= 0 && z < size[2]; }
};

/// One scene of a graph as the kernels see it.
struct PointScene {
  CellBox box;
  int64_t first_particle = 0, particles = 0;  ///< of all nodes
  int64_t first_point = 0;                    ///< of all scenes' obstacle points
  const Vec3f* point = nullptr;               ///< obstacle points, unturned
  AxisMap symmetry;
  EnvironmentView environment;
};

/// Numbers that a build leaves on the device.
struct GraphCounts {
  int32_t nodes, obstacles, edges;  ///< all 0 where there was no room, so that what runs on them does nothing
  int32_t wanted_nodes, wanted_edges;
  int32_t fault;     ///< no room for the edges
  int32_t overflow;  ///< 2^31 edges or more
};

struct ResetCounts {
  int64_t particles;
  GraphCounts* counts;
  GRAUPEL_HD void operator()(int64_t) const {
    *counts = {};
    counts->wanted_nodes = static_cast<int32_t>(particles);
  }
};

/// What all launches see.
struct Points {
  const PointScene* scene;
  int scenes;
  double cell_size, inverse_size;
  int64_t particles;
  int32_t cells;
  const Vec3f* position;    ///< [nodes]
  const int32_t* point_of;  ///< [obstacle particles] number of an obstacle particle's point

  /// Scene of obstacle point j, particle i.
  GRAUPEL_HD const PointScene& scene_of_point(int64_t j) const {
    int low = 0, high = scenes;
    while (high - low > 1) {
      const int middle = (low + high) / 2;
      (scene[middle].first_point <= j ? low : high) = middle;
    }
    return scene[low];
  }
  GRAUPEL_HD const PointScene& scene_of_node(int64_t i) const {
    if (i >= particles) return scene_of_point(point_of[i - particles]);
    int low = 0, high = scenes;
    while (high - low > 1) {
      const int middle = (low + high) / 2;
      (scene[middle].first_particle <= i ? low : high) = middle;
    }
    return scene[low];
  }
  /// Cell within the box.
  GRAUPEL_HD Vec3i cell_of(const CellBox& box, const Vec3f& x) const {
    Vec3i cell;
    for (int d = 0; d < 3; ++d) {
      const double at = std::floor(static_cast<double>(x[d]) * inverse_size) - box.low[d];
      cell[d] = at >= box.size[d] ? box.size[d] - 1 : at > 0 ? static_cast<int>(at) : 0;  // 0 for what is no number
    }
    return cell;
  }
};

/// number += 1, by many at once; returns the number before.
GRAUPEL_HD inline int32_t add_one(int32_t& number) {
#ifdef __CUDA_ARCH__
  return atomicAdd(&number, 1);
#else
  return std::atomic_ref<int32_t>(number).fetch_add(1, std::memory_order_relaxed);
#endif
}

struct ClearCells {
  int32_t *count, *filled;
  GRAUPEL_HD void operator()(int64_t c) const { count[c] = filled[c] = 0; }
};

/// Cell of node i, -1 where there is no such node; nodes of each cell.
struct CountNodes {
  Points points;
  const GraphCounts* counts;  ///< null: the particles alone
  int32_t *cell_of, *count;
  GRAUPEL_HD void operator()(int64_t i) const {
    cell_of[i] = -1;
    if (i >= (counts ? counts->wanted_nodes : points.particles)) return;
    const CellBox& box = points.scene_of_node(i).box;
    const Vec3i cell = points.cell_of(box, points.position[i]);
    cell_of[i] = box.row_of(cell[1], cell[2]) + cell[0];
    add_one(count[cell_of[i]]);
  }
};

/// Nodes by cells, those of a cell in any order.
struct FillCells {
  const int32_t *cell_of, *begin;
  int32_t *filled, *unsorted;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t c = cell_of[i];
    if (c >= 0) unsorted[begin[c] + add_one(filled[c])] = static_cast<int32_t>(i);
  }
};

/// Those of a cell in ascending order, and their positions.
struct SortNodes {
  const int32_t *cell_of, *begin, *unsorted;
  const Vec3f* position;
  int32_t* node;
  Vec3f* sorted;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t c = cell_of[i];
    if (c < 0) return;
    int32_t place = begin[c];
    for (int32_t k = begin[c]; k < begin[c + 1]; ++k) place += unsorted[k] < i;
    node[place] = static_cast<int32_t>(i);
    sorted[place] = position[i];
  }
};

/// Nodes in the order of their cells.
struct CellOrder {
  const int32_t* begin;   ///< [cells + 1]
  const int32_t* node;    ///< [nodes]
  const Vec3f* position;  ///< [nodes]
};

/// Whether obstacle point j is no farther than `receptive_field` from some particle of its scene, turned as they are.
struct MarkNear {
  Points points;
  CellOrder order;
  double receptive_field;
  int32_t* near;
  GRAUPEL_HD void operator()(int64_t j) const {
    const PointScene& scene = points.scene_of_point(j);
    const Vec3f x = scene.symmetry.apply(scene.point[j - scene.first_point]);
    near[j] = is_near(scene.box, x);
  }
  GRAUPEL_HD bool is_near(const CellBox& box, const Vec3f& x) const {
    const Vec3i home = points.cell_of(box, x);
    const int cells = static_cast<int>(std::ceil(receptive_field * points.inverse_size));
    for (int a = 0; a <= 2 * cells; ++a)  // 0, 1, -1, 2 ..: what is near is found early
      for (int b = 0; b <= 2 * cells; ++b) {
        const int dy = a % 2 ? (a + 1) / 2 : -a / 2, dz = b % 2 ? (b + 1) / 2 : -b / 2;
        const double y = gap(dy), z = gap(dz);
        if (y * y + z * z > receptive_field * receptive_field || !box.has_row(home[1] + dy, home[2] + dz)) continue;
        const int32_t row = box.row_of(home[1] + dy, home[2] + dz);
        const int first = home[0] - cells < 0 ? 0 : home[0] - cells;
        const int last = home[0] + cells >= box.size[0] ? box.size[0] - 1 : home[0] + cells;
        for (int32_t i = order.begin[row + first]; i < order.begin[row + last + 1]; ++i)
          if (norm2(x.cast<double>() - order.position[i].cast<double>()) <= receptive_field * receptive_field)
            return true;
      }
    return false;
  }
  /// Least distance along an axis of points of cells that are d cells apart.
  GRAUPEL_HD double gap(int d) const { return (d < 0 ? -d - 1 : d > 0 ? d - 1 : 0) * points.cell_size; }
};

/// Puts the near points behind the particles.
struct PlaceObstacles {
  Points points;
  int64_t most;  ///< obstacle points
  const int32_t *near, *rank;
  Vec3f* position;
  int32_t* point_of;
  GraphCounts* counts;
  GRAUPEL_HD void operator()(int64_t j) const {
    if (j == most) {
      counts->wanted_nodes = static_cast<int32_t>(points.particles) + rank[most];
      return;
    }
    if (!near[j]) return;
    const PointScene& scene = points.scene_of_point(j);
    position[points.particles + rank[j]] = scene.symmetry.apply(scene.point[j - scene.first_point]);
    point_of[rank[j]] = static_cast<int32_t>(j);
  }
};

inline constexpr int neighbour_rows = 9;

/// The nodes within the radius of node i in one of the nine rows of cells about it: item 9 i + row.
struct RowSearch {
  Points points;
  CellOrder order;
  double radius2;

  template <typename Visit>
  GRAUPEL_HD void visit(int64_t i, int row, const Visit& visit_node) const {
    const CellBox& box = points.scene_of_node(i).box;
    const Vec3f x = points.position[i];
    const Vec3i home = points.cell_of(box, x);
    const int y = home[1] + row % 3 - 1, z = home[2] + row / 3 - 1;
    if (!box.has_row(y, z)) return;
    const int32_t at = box.row_of(y, z) + home[0];
    const int32_t first = home[0] > 0 ? at - 1 : at, last = home[0] + 1 < box.size[0] ? at + 1 : at;
    for (int32_t k = order.begin[first]; k < order.begin[last + 1]; ++k)
      if (norm2(order.position[k].cast<double>() - x.cast<double>()) <= radius2) visit_node(order.node[k]);
  }
};

struct CountPairs {
  RowSearch search;
  const GraphCounts* counts;
  int32_t* count;
  GRAUPEL_HD void operator()(int64_t item) const {
    const int64_t i = item / neighbour_rows;
    int32_t found = 0;
    if (i < counts->wanted_nodes) search.visit(i, static_cast<int>(item % neighbour_rows), [&](int32_t) { ++found; });
    count[item] = found;
  }
};

/// Whether the running sums have passed 2^31: then one is less than that before it.
struct FindOverflow {
  const int32_t* sum;
  GraphCounts* counts;
  GRAUPEL_HD void operator()(int64_t item) const {
    if (sum[item + 1] < sum[item]) counts->overflow = 1;
  }
};

/// Where the edges of receiver i begin; item 0 settles the counts.
struct BeginEdges {
  int64_t most_nodes, capacity, particles;
  const int32_t* sum;  ///< [9 most_nodes + 1]
  GraphCounts* counts;
  int32_t* begin;  ///< [most_nodes + 1]
  GRAUPEL_HD void operator()(int64_t i) const {
    begin[i] = sum[neighbour_rows * i];
    if (i > 0) return;
    const int32_t edges = sum[neighbour_rows * most_nodes];
    counts->wanted_edges = edges;
    counts->fault = counts->overflow || edges > capacity;
    counts->nodes = counts->fault ? 0 : counts->wanted_nodes;
    counts->obstacles = counts->fault ? 0 : counts->wanted_nodes - static_cast<int32_t>(particles);
    counts->edges = counts->fault ? 0 : edges;
  }
};

/// Senders of a receiver, in the order of the rows of cells.
struct FillPairs {
  RowSearch search;
  const GraphCounts* counts;
  const int32_t* sum;
  int32_t *sender, *receiver;
  GRAUPEL_HD void operator()(int64_t item) const {
    const int64_t i = item / neighbour_rows;
    if (i >= counts->nodes) return;
    int32_t place = sum[item];
    search.visit(i, static_cast<int>(item % neighbour_rows), [&](int32_t s) {
      sender[place] = s;
      receiver[place++] = static_cast<int32_t>(i);
    });
  }
};

/// Sender of an edge at its place among those of the receiver, ascending.
struct SortSenders {
  const GraphCounts* counts;
  const int32_t *begin, *receiver, *unsorted;
  int32_t* sender;
  GRAUPEL_HD void operator()(int64_t e) const {
    if (e >= counts->edges) return;
    const int32_t r = receiver[e], s = unsorted[e];
    int32_t place = begin[r];
    for (int32_t other = begin[r]; other < begin[r + 1]; ++other) place += unsorted[other] < s;
    sender[place] = s;
  }
};

/// The edge back, and an edge's features.
struct DescribeEdges {
  const GraphCounts* counts;
  double radius;
  const Vec3f* position;
  const int32_t *begin, *sender, *receiver;
  int32_t* reverse;
  float* features;
  GRAUPEL_HD void operator()(int64_t e) const {
    if (e >= counts->edges) return;
    const int32_t r = receiver[e], s = sender[e];
    int32_t low = begin[s], high = begin[s + 1];
    while (high - low > 1) {
      const int32_t middle = (low + high) / 2;
      (sender[middle] <= r ? low : high) = middle;
    }
    reverse[e] = low;
    write_edge_features(position[s], position[r], radius, features + int64_t{edge_feature_count} * e);
  }
};

/// Features and type of obstacle particle i, which rests.
struct DescribeObstacles {
  Points points;
  const GraphCounts* counts;
  FeatureRules rules;
  int32_t type;
  float* features;
  int32_t* type_row;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (i >= counts->wanted_nodes - points.particles) return;
    const PointScene& scene = points.scene_of_point(points.point_of[i]);
    Vec3f position[most_history + 1];
    for (int t = 0; t <= rules.history; ++t) position[t] = scene.point[points.point_of[i] - scene.first_point];
    const int64_t row = points.particles + i;
    write_feature_row(rules, scene.environment, scene.symmetry, no_material, position, features + row * rules.width);
    type_row[row] = type;
  }
};

}  // namespace graupel::graph::radius
