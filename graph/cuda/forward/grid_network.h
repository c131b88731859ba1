// A graph network that predicts frames on a GPU: launches alone, so that a frame can be recorded once. The grid is
// built beside what does not need it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/math/vec.h"
#include "graph/config/hgn_config.h"
#include "graph/cuda/launch/launch_hooks.h"
#include "graph/topology/fixed_capacity_levels.h"
#include "graph/topology/grid_builder.h"
#include "nn/weights.h"

namespace graupel::graph {

/// What a frame is predicted from, in the GPU's memory.
struct GridInputs {
  int64_t particles = 0;
  std::vector<int64_t> particles_of_scene = {};  ///< of scenes that follow each other; their sum is `particles`
  const float* features = nullptr;               ///< [particles, input_width - embedding]
  const int32_t* type_row = nullptr;             ///< [particles]
  const Vec3f* position = nullptr;               ///< [particles]
  Vec3d origin = {};                             ///< of the grid [m]
  GridLinks grid = {};
  LevelCapacity capacity;  ///< frames with more cells than that are not predicted
};

class GridNetwork {
 public:
  virtual ~GridNetwork() = default;
  /// Allocates the capacity; what follows reads these inputs.
  virtual void prepare(const GridInputs& inputs) = 0;
  /// Before each further launch(), and outside of a recording.
  virtual void reset() {}
  /// What the grid's stream does after the grid was built.
  virtual void follow_grid(void* grid_stream) = 0;
  /// The moments' graph is the grid.
  virtual void launch(void* stream, const LaunchHooks& moments) = 0;

  virtual const float* output() const = 0;  ///< [particles, output_width()] normalised accelerations
  /// Not 0 where the grid has overflowed or there was no room for it; the output is of no use then.
  virtual const int32_t* fault() const = 0;
};

/// The one that the weights ask for. Throws ConfigError where there is none.
std::unique_ptr<GridNetwork> make_grid_network(const HgnConfig& config, const nn::Weights& weights);

}  // namespace graupel::graph
