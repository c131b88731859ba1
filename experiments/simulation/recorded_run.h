// A run of the solver with its trajectory and its saved states on the disk.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "experiments/simulation/simulate.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

class RecordedRun {
 public:
  /// Starts the scene, or goes on from `saved` where that is given. All arguments must outlive the run. Throws
  /// ConfigError, naming the scene's file, for a scene that cannot be run, InputError for a state of another scene.
  RecordedRun(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation,
              const std::optional<io::SavedRun>& saved);

  /// Runs and writes the frames that are left. Throws DivergedError once the frames before are written, with the bad
  /// state in OUTPUT.blowup.h5; Error(interrupted) once the state is saved where that was asked for.
  void finish();
  /// Prints what was run, and writes it to --json.
  void report() const;

 private:
  void warn_of_unused_friction() const;
  const std::string& output() const { return options_.output; }
  void append_frame();
  void advance();
  void advance_substeps();
  [[noreturn]] void stop(const std::vector<std::byte>* state = nullptr);
  void save(const std::vector<ParticleFrame>& recent, const std::vector<std::byte>* state = nullptr) const;

  const SimulateOptions& options_;
  const Scene& scene_;
  io::TrajectoryWriteOptions write_;
  const std::optional<io::SavedRun>& saved_;
  std::unique_ptr<mpm::Simulation> run_;
  Trajectory header_;
  std::unique_ptr<io::TrajectoryWriter> writer_;
  int64_t frame_ = 0;            ///< finished ones
  double frame_seconds_ = 1e30;  ///< that the last one took
  int64_t substeps_before_ = 0;  ///< of the run that was saved
};

}  // namespace graupel::experiments
