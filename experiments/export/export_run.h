// What `graupel export` does: frames of a trajectory as particles, surfaces or pictures for other programs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::experiments {

struct ExportRequest {
  std::string input;                    ///< trajectory or data set
  int trajectory = 0;                   ///< which of a data set
  std::string format = "vtp";           ///< of export_formats()
  std::string folder;                   ///< "": <name>_<format>; of csv a file, "": <input>_forces.csv
  std::string name;                     ///< of the files; "": that of the input
  std::string frames;                   ///< parse_frame_range
  bool surface = false;                 ///< surfaces of the materials instead of particles
  std::optional<double> radius, voxel;  ///< SurfaceSettings [m]; default by the scene's dx
  std::optional<int> smoothing;         ///< SurfaceSettings
  std::optional<double> rate;           ///< pictures of a film a second; default as many as the run has frames
  std::optional<int> width, height;     ///< of pictures [pixels]; default default_width, default_height
};

inline constexpr int default_width = 960, default_height = 540;  ///< [pixels]

/// Of particles, of surfaces, of pictures and of forces (csv), without repetitions.
std::vector<std::string> export_formats();

/// Progress goes to standard error, what was written also to --json. Throws ConfigError, InputError, IoError,
/// DivergedError; Ctrl-C ends it between two frames.
void run_export(const ExportRequest& request, CommonOptions& common);

}  // namespace graupel::experiments
