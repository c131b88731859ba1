// Obstacles that a script moves: their poses at the start and at the end of each substep, and their velocity. They are
// looked up where material is; only obstacles at rest are kept by node (mpm/grid/obstacle_nodes.h).
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "mpm/particles/rigid_step.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

/// For kernels; arrays have one entry an obstacle of the scene, at rest or not. Those of several substeps lie one after
/// another.
template <typename T>
struct MovingObstacleView {
  int32_t count;                      ///< of moving ones
  const int32_t* index;               ///< [count] their places in the scene
  sparsegrid::ObstacleSetView start;  ///< poses at the start of the substep
  sparsegrid::ObstacleSetView end;    ///< at its end
  const RigidStep<T>* step;           ///< zero for obstacles at rest

  /// The same `substeps` later.
  GRAUPEL_HD MovingObstacleView later(int32_t substeps) const {
    MovingObstacleView view = *this;
    const int64_t entries = int64_t(substeps) * start.count;
    view.start.obstacles += entries;
    view.end.obstacles += entries;
    view.step += entries;
    return view;
  }
};

/// Poses and velocities of equal substeps, one after another.
template <typename T>
struct ObstacleSteps {
  std::vector<sparsegrid::ObstacleView>
      poses;                        ///< [substeps + 1, obstacles] at their starts, and at the end of the last
  std::vector<RigidStep<T>> steps;  ///< [substeps, obstacles]
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
  MovingObstacleView<T> view() const { return view_of(poses_.data(), steps_.data()); }
  /// The poses and velocities of the substeps of `dt` seconds each from `time` on.
  ObstacleSteps<T> substeps(double time, double dt, int64_t count) const;
  /// The first of the substeps whose arrays lie there on the device.
  MovingObstacleView<T> view_of(const sparsegrid::ObstacleView* poses, const RigidStep<T>* steps) const;
  /// [moving ones] their places in the scene.
  const std::vector<int32_t>& index() const { return index_; }
  /// Largest speed of a point of a surface at any time in [from, to] [m/s].
  double largest_speed(double from, double to) const;

 private:
  Device device_ = Device::cpu;
  Scene scene_;
  sparsegrid::ObstacleSet obstacles_;
  std::vector<int32_t> index_;
  std::vector<double> reach_;  ///< [of index_] largest distance of a surface point from the centre of the motion [m]
  Buffer<int32_t> device_index_;
  Buffer<sparsegrid::ObstacleView> fixed_, poses_;
  Buffer<RigidStep<T>> steps_;
};

}  // namespace graupel::mpm
