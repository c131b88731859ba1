// Massless points that a run carries along: moved by its grid's velocity each substep and kept inside the walls and out
// of obstacles as particles are. They are born when they are told to, and leave through open walls and sinks as
// particles do. They show where a run on another grid takes the particles of this one, and leave the run's own bytes as
// they are.
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
  /// `birth_time` [n] [s]: those after `now` wait at their position until then; empty: all are always there. Throws
  /// ConfigError for lists of other lengths.
  Tracers(Device device, const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
          const std::vector<double>& birth_time, double now);
  bool any() const { return position_.size() > 0; }
  std::vector<Vec3f> positions() const;  ///< [m]
  /// [n], 1 for those in the run; empty where all always are.
  std::vector<uint8_t> active() const;

  /// After the grid of a substep has its velocities: v = sum_i w_i v_i over the nodes with mass, over the sum of their
  /// weights where some have none; where all have none the point falls freely. Then x <- x + dt v. One that is born in
  /// the substep moves with its own velocity, as a particle does.
  void move(const SolverView<T>& view, T dt);

 private:
  Buffer<Vec<T, 3>> position_, velocity_;
  Buffer<double> birth_time_;
  Buffer<Presence> presence_;
};

}  // namespace graupel::mpm
