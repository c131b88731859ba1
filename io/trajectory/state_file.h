// Saved states of runs in files. A file is
//   "graupel-state 1\n", u64 length of the header, header (JSON: whose state it is, lengths of what follows), scene
//   (JSON), the last frames (f64 time, then f32 arrays as in a trajectory), the solver's state, u64 checksum (FNV-1a of
//   all before it); numbers little endian. docs/reference/file_formats.md describes it for users.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/particle_fields.h"
#include "core/scene/trajectory.h"

namespace graupel::io {

/// All that a run needs to go on, anywhere.
struct SavedRun {
  std::string version;    ///< of the program, "graupel 0.1.0"
  std::string device;     ///< "cpu" or "cuda"
  std::string precision;  ///< "f32" or "f64"
  uint64_t seed = 0;
  int64_t frame = 0;  ///< number of the last finished one
  double time = 0;    ///< [s]
  int64_t particles = 0;
  std::string scene_json;
  std::string output;    ///< the trajectory, absolute
  bool velocity = true;  ///< what the trajectory stores beside positions
  bool active = false;
  FieldSet fields = {};
  bool forces = false;
  std::vector<ParticleFrame> recent;  ///< last frames that the trajectory may lack (TrajectoryWriter::checkpoint)
  std::vector<std::byte> state;       ///< of the solver
};

/// Written aside and renamed: a kill leaves the file that was there. Throws IoError.
void write_state_file(const std::string& path, const SavedRun& run);
/// Throws InputError for a file that is missing, of another kind or format version, cut short or damaged.
SavedRun read_state_file(const std::string& path);
/// Whether a file begins as saved states do.
bool is_state_file(const std::string& path);

}  // namespace graupel::io
