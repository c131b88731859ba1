// Runs scenes in the latent space of one reduced-order model on a GPU: many instances with parameters of their own
// advance together, and the host waits once a frame (docs/reference/reduced-order.md). As rom/reduced_solver.h does on
// the CPU, in single precision with Gauss-Newton in double.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/trajectory.h"
#include "rom/reduced_solver.h"

namespace graupel::rom {

namespace device {
class DeviceRun;
struct InstanceState;
}  // namespace device

/// A run: its scene and the model's parameters in it.
struct ReducedInstance {
  mpm::PreparedScene prepared;  ///< for Device::cpu; the solver takes what it needs to the GPU
  std::vector<double> parameters;
};

class ReducedDeviceSolver {
 public:
  /// All instances must have one frame time. Throws ConfigError as ReducedSolver; without a GPU, or in a build without
  /// CUDA; and for a model or scene that the kernels do not know (rom/cuda/device_tables.h).
  ReducedDeviceSolver(const ReducedModel& model, std::vector<ReducedInstance> instances, const ReducedOptions& options);
  ~ReducedDeviceSolver();
  ReducedDeviceSolver(const ReducedDeviceSolver&) = delete;
  ReducedDeviceSolver& operator=(const ReducedDeviceSolver&) = delete;

  int count() const { return static_cast<int>(parameters_.size()); }
  double time() const { return time_; }
  int64_t steps_per_frame() const { return steps_; }
  /// One frame of every instance that has not diverged.
  void advance_frame();
  /// The same; seconds of its steps on the GPU, by its own clock.
  double timed_frame();
  /// What each of a step's kernels takes on the GPU, by name [s]. The run is of no use afterwards.
  std::vector<std::pair<std::string, double>> kernel_seconds();
  /// Why an instance has diverged; nothing while it has not. Its state is then that before the bad step.
  std::optional<std::string> divergence(int instance) const;
  LatentState state(int instance) const;
  /// Positions and velocities of all particles, in the order of the sources.
  ParticleFrame frame(int instance) const;
  /// Of the last frame.
  ErrorIndicator trust(int instance) const;
  ReducedStatistics statistics(int instance) const;

 private:
  const device::InstanceState& report(int instance) const;

  const ReducedModel& model_;
  std::vector<std::vector<double>> parameters_;
  std::unique_ptr<device::DeviceRun> run_;
  int64_t steps_ = 1, samples_ = 0;
  double dt_ = 0, time_ = 0, seconds_ = 0;
};

}  // namespace graupel::rom
