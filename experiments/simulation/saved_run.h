// States of `simulate` in files: what a run writes, and what another one makes of it.
#pragma once

#include <string>

#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

/// What the user asked of a run that a saved state decides as well; empty where nothing was said.
struct RunRequest {
  std::string device, precision, seed, fields;
  bool no_velocity = false, forces = false;
};

/// Reads a state. Throws InputError, naming the file, when it is of another version or kind of device, or when the user
/// wishes something else than the run had.
io::SavedRun read_saved_run(const std::string& file, const RunRequest& wishes);

/// The scene to go on with: the one in `scene_file`, or the state's when that is empty.
Scene scene_of(const io::SavedRun& saved, const std::string& state_file, const std::string& scene_file,
               const std::vector<std::string>& overrides);

/// Puts a new simulation into the saved state. Throws InputError, naming both files, when the scene is another one: it
/// may differ in texts and the number of frames only.
void restore(mpm::Simulation& run, const io::SavedRun& saved, const std::string& state_file,
             const std::string& scene_file);

/// Where the trajectory goes on.
io::TrajectoryCheckpoint checkpoint_of(const mpm::Simulation& run, const io::SavedRun& saved);

}  // namespace graupel::experiments
