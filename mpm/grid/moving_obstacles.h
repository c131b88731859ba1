// Obstacles that a script moves: their poses at the start and at the end of each substep, and their velocity. They are
// looked up where material is; only obstacles at rest are kept by node (mpm/grid/obstacle_nodes.h).
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "mpm/particles/rigid_step.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

/// For kernels; arrays have one entry an obstacle of the scene, at rest or not.
template <typename T>
struct MovingObstacleView {
  int32_t count;                      ///< of moving ones
  const int32_t* index;               ///< [count] their places in the scene
  sparsegrid::ObstacleSetView start;  ///< poses at the start of the substep
  sparsegrid::ObstacleSetView end;    ///< at its end
  const RigidStep<T>* step;           ///< zero for obstacles at rest
};

template <typename T>
class MovingObstacles {
 public:
  MovingObstacles() = default;
  MovingObstacles(Device device, const Scene& scene, const sparsegrid::ObstacleSet& obstacles);

  bool any() const { return !index_.empty(); }
  /// The obstacles at rest; the others are there, but nowhere near.
  sparsegrid::ObstacleSetView fixed() const;
  /// Sets the poses and velocities of the substep of `dt` seconds from `time` on.
  void begin_step(double time, double dt);
  MovingObstacleView<T> view() const;
  /// Largest speed of a point of a surface at any time in [from, to] [m/s].
  double largest_speed(double from, double to) const;

 private:
  Device device_ = Device::cpu;
  Scene scene_;
  sparsegrid::ObstacleSet obstacles_;
  std::vector<int32_t> index_;
  std::vector<double> reach_;  ///< [of index_] largest distance of a surface point from the centre of the motion [m]
  Buffer<int32_t> device_index_;
  Buffer<sparsegrid::ObstacleView> fixed_, start_, end_;
  Buffer<RigidStep<T>> steps_;
};

}  // namespace graupel::mpm
