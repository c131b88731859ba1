// What the exporters share: checked names, numbered frame files, little-endian bytes.
#pragma once

#include <string>

#include "core/scene/trajectory.h"

namespace graupel::io {

/// Makes the folder. Throws ConfigError for a name with other characters than A-Z a-z 0-9 . _ - and for a trajectory
/// without frames.
void prepare_export(const Trajectory& trajectory, const std::string& folder, const std::string& name);
/// "<name>_0007<ending>", with more digits where there are more frames.
std::string frame_file_name(const std::string& name, std::size_t frame, const std::string& ending);
/// The particles of a frame that are in the run: what is exported.
struct ActiveFrame {
  ParticleFrame frame;
  std::vector<int32_t> particle_type, id;  ///< [n] of those; id is the place in the trajectory
};
ActiveFrame active_particles(const Trajectory& trajectory, const ParticleFrame& frame);
/// Appends the bytes of a number as they lie in memory (little-endian on every machine this runs on).
template <typename T>
void append_bytes(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace graupel::io
