// Several scenes as one graph: particles and cells of all scenes follow each other, indices are offset per scene, and
// nothing is padded. Obstacle particles of GNS stand behind the particles of all scenes, so that they are rows of the
// inputs alone. Everything lies in two arrays (numbers and indices), so that a batch reaches a device in two
// copies.
#pragma once

#include <cstdint>
#include <vector>

#include "graph/topology/level_graph.h"
#include "sparsegrid/hierarchy.h"
#include "sparsegrid/radius_graph.h"

namespace graupel::train {

/// A part of one of the batch's two arrays.
struct Part {
  int64_t begin = 0, count = 0;
};

/// All parts lie in `indices`.
using BatchLevel = graph::LevelGraph<Part>;

struct Batch {
  std::vector<int64_t> particle_begin = {0};  ///< [scenes + 1]
  std::vector<float> numbers;
  std::vector<int32_t> indices;
  int64_t feature_width = 0;
  int64_t target_width = 0;  ///< 3 k for the accelerations of k frames; 0 for inference

  Part features;       ///< numbers [particles and obstacle particles, feature_width]
  Part weight;         ///< numbers [particles, 8] trilinear
  Part offset;         ///< numbers [particles, 3]
  Part target;         ///< numbers [particles, target_width] normalised accelerations; empty for inference
  Part counted;        ///< numbers [particles] 1 for those that the loss counts, 0; empty where it counts all
  Part type_row;       ///< indices [particles and obstacle particles] rows of the embedding table
  Part edge_features;  ///< of links between particles: numbers [edges, 4]
  Part cell;           ///< indices [particles, 8] level-0 cells
  Part pair_begin;     ///< indices [cells + 1] (particle, corner) pairs of a level-0 cell
  Part pair;           ///< indices [particles * 8] pairs sorted by cell
  std::vector<BatchLevel> level;  ///< finest first; of GNS one, whose cells are all particles

  /// Particles that the loss does not count: kinematic ones (core/scene/kinematic_particles.h), and those that leave.
  int64_t uncounted = 0;

  int64_t scenes() const { return static_cast<int64_t>(particle_begin.size()) - 1; }
  int64_t particles() const { return particle_begin.back(); }
};

/// What the network needs of one scene at one time.
struct SceneGraph {
  std::vector<float> features;         ///< [particles, feature_width], graph::particle_features
  std::vector<int32_t> type_row;       ///< [particles]
  sparsegrid::Hierarchy<3> hierarchy;  ///< of HGN; without levels for GNS
  sparsegrid::RadiusGraph links;       ///< between particles, of GNS
  std::vector<float> edge_features;    ///< of these [edges, 4], graph::edge_features
  int64_t obstacle_particles = 0;      ///< of GNS: the last rows of features and type_row
  std::vector<float> target;           ///< [particles without those of obstacles, 3 k], or empty
  std::vector<uint8_t> leaves;         ///< [the same] 1 for those that are gone in a frame of the target, or empty

  /// Particles that move.
  int64_t moving() const { return static_cast<int64_t>(type_row.size()) - obstacle_particles; }
};

/// Joins scenes of one architecture in order. All must have the same number of levels and features, and all or none a
/// target.
Batch concatenate(const std::vector<SceneGraph>& scenes);

}  // namespace graupel::train
