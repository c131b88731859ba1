// Massless points that a run carries along: moved by its grid's velocity each substep and kept inside the walls and out
// of obstacles as particles are. They show where a run on another grid takes the particles of this one, and leave the
// run's own bytes as they are.
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

/// Points and their velocities [n], in the order in which they were given.
template <typename T>
class Tracers {
 public:
  Tracers() = default;
  Tracers(Device device, const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity);
  bool any() const { return position_.size() > 0; }
  std::vector<Vec3f> positions() const;  ///< [m]

  /// After the grid of a substep has its velocities: v = sum_i w_i v_i over the nodes with mass, over the sum of their
  /// weights where some have none; where all have none the point falls freely. Then x <- x + dt v.
  void move(const SolverView<T>& view, T dt);

 private:
  Buffer<Vec<T, 3>> position_, velocity_;
};

/// Throws ConfigError for what tracers do not know: two dimensions, periodic and open walls.
void check_carries_tracers(const Scene& scene);

}  // namespace graupel::mpm
