// The part of a batch made on a device that depends on the architecture: who is linked to whom.
#pragma once

#include <memory>
#include <vector>

#include "graph/topology/grid_builder.h"
#include "graph/topology/radius_graph_builder.h"
#include "train/data/sampling.h"

namespace graupel::train {

/// A batch in the device's memory, as a Batch has it on the host; valid until the call of DeviceSamples::start() after
/// the next one. Rows are particles; of GNS those of obstacles stand behind them.
struct SampleArrays {
  int64_t particles = 0, rows = 0;
  int64_t uncounted = 0;  ///< of the particles, by the loss
  int feature_width = 0, target_width = 0;
  const float* features = nullptr;    ///< [rows, feature_width]
  const float* target = nullptr;      ///< [particles, target_width]
  const float* counted = nullptr;     ///< [particles] 1 for those that the loss counts, 0; null where it counts all
  const int32_t* type_row = nullptr;  ///< [rows]
  graph::GridLinks links{};           ///< of HGN
  graph::GridCounts counts;           ///< of HGN
  graph::RadiusLinks pairs{};         ///< of GNS
  int64_t pair_count = 0;
};

class SampleGraph {
 public:
  virtual ~SampleGraph() = default;

  struct Scene {
    SampleDraw draw;
    int64_t particles = 0;
    const Vec3f* point = nullptr;  ///< [points] obstacle particles, unturned, in the device's memory
    int64_t points = 0;
    graph::EnvironmentView environment;
  };
  /// Memory for a batch of scenes.
  virtual void prepare(const std::vector<Scene>& scenes, void* stream) = 0;
  /// Rows that the batch may have.
  virtual int64_t most_rows() const = 0;

  /// What is made of the particles already; rows of obstacle particles are written.
  struct Rows {
    Vec3f* position;  ///< turned
    float* features;
    int32_t* type_row;
  };
  /// Launches alone.
  virtual void build(const graph::FeatureRules& rules, const Rows& rows, void* stream) = 0;
  /// Waits for build() and fills in `rows`, the links and their counts.
  virtual void finish(SampleArrays& arrays, void* stream) = 0;
};

/// Obstacle particles of every trajectory's scene, made on all threads; none where the network has none.
std::vector<const std::vector<Vec3f>*> obstacle_points(const DataSplit& split, const NetworkConfig& config);

std::unique_ptr<SampleGraph> make_sample_graph(const NetworkConfig& config, Device device);

}  // namespace graupel::train
