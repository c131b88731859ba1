// The loads of a run (core/scene/load.h): who carries them, and the impulses that a substep gives.
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "mpm/particles/state_bytes.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

template <typename T>
class RunLoads {
 public:
  RunLoads(Device device, const std::vector<TimedLoad>& loads, std::size_t particles);

  /// Whether one acts in the substep of `dt` from `time` on [s].
  bool act(double time, double dt) const;
  /// Changes the carriers' velocities by the impulses of the substep; returns the momentum that this gave [kg m/s].
  /// Carriers of a load that starts in it are what is in its ball now.
  Vec3d push(const SolverView<T>& view, double time, double dt);
  /// For loads that start in [time, time + dt], a frame: what would carry them now stands for their carriers until
  /// then.
  void expect(const SolverView<T>& view, double time, double dt);
  /// At least the speed that they add to a particle in [time, time + dt] [m/s].
  double largest_gain(double time, double dt) const;
  /// Those that met nothing to carry them.
  int64_t without_carriers() const;

  std::size_t state_bytes() const;
  void save(StateWriter& writer) const;
  void load(StateReader& reader);
  /// Throws InputError for what no run leaves.
  void check_state() const;

 private:
  struct Course {
    int64_t carriers = -1;  ///< of the load; -1 before its start
    double mass = 0;        ///< theirs together [kg]
  };
  uint8_t* carries(std::size_t load) { return carries_.data() + load * particles_; }

  std::vector<TimedLoad> loads_;
  std::size_t particles_;
  std::vector<Course> courses_;        ///< [loads]
  std::vector<double> expected_mass_;  ///< [loads] before the start [kg]; 0: nothing known
  Buffer<uint8_t> carries_;            ///< [loads, particles], by the particles' place in the order of the sources
  Buffer<CarrierSum> sums_;
  Buffer<Impulse> impulses_;
};

extern template class RunLoads<float>;
extern template class RunLoads<double>;

}  // namespace graupel::mpm
