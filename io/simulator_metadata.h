// metadata.json of data sets for graph networks: what GNS (DeepMind, geoelements) and LagrangeBench read, and the few
// keys of our own that are needed to come back.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace graupel::io {

/// Means and standard deviations of each axis: velocities are differences of frames [m/frame], accelerations
/// differences of velocities [m/frame^2].
struct MotionFigures {
  std::vector<double> velocity_mean, velocity_std, acceleration_mean, acceleration_std;
};

struct SimulatorMetadata {
  std::string name;                           ///< "case"
  int dimensions = 3;                         ///< 2 or 3
  std::vector<std::array<double, 2>> bounds;  ///< [dimensions] where walls hold the particles [m]
  std::vector<bool> periodic;                 ///< [dimensions]
  double frame_time = 0;                      ///< dt * write_every [s]
  double connectivity_radius = 0;             ///< [m]
  MotionFigures motion;
  std::optional<double> particle_spacing;        ///< "dx" [m]
  std::optional<double> grid_spacing;            ///< of our own scenes [m]
  std::optional<std::array<double, 3>> gravity;  ///< of our own scenes [m/s^2]
};

/// Throws InputError, naming file, key and what was found, for a key that is missing, of another kind, out of its range
/// or does not fit the others. Where GNS's file has one part for the training and one for rollouts, that of the
/// training counts.
SimulatorMetadata read_simulator_metadata(const std::string& file);

/// What of a split its metadata say.
struct SplitFigures {
  int64_t trajectories = 0, most_particles = 0;
  int64_t fewest_frames = 0, most_frames = 0;
  bool material_property = false;
};

/// Text of metadata.json for geoelements/gns: sequence_length is the number of frames, null where it differs.
std::string gns_metadata_text(const SimulatorMetadata& metadata, const std::map<std::string, SplitFigures>& splits,
                              const std::map<int64_t, std::string>& type_names);
/// The same for LagrangeBench: sequence lengths are the number of frames less one.
std::string lagrangebench_metadata_text(const SimulatorMetadata& metadata,
                                        const std::map<std::string, SplitFigures>& splits,
                                        const std::map<int64_t, std::string>& type_names);

}  // namespace graupel::io
