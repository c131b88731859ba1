// Data sets of learned simulators from one format to another: our own, geoelements/gns, LagrangeBench. Positions keep
// their bits (f64 ones are rounded to f32).
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/scene.h"
#include "io/data_set_format.h"
#include "io/simulator_metadata.h"

namespace graupel::io {

struct ConversionOptions {
  std::string input;   ///< folder
  std::string output;  ///< folder, new or empty
  DataSetFormat format = DataSetFormat::graupel;
  std::string types;                ///< "5=water,6=sand": of the other program's format, see ParticleTypeTable
  std::vector<std::string> splits;  ///< empty: all
  std::vector<std::string> set;     ///< changes of the scenes' keys, where the output is ours
  std::optional<double> connectivity_radius;                  ///< [m]; default the input's
  std::string made_by;                                        ///< the program and its version
  std::function<void(int64_t done, int64_t total)> progress;  ///< after each trajectory; may throw to stop
};

struct ConversionResult {
  DataSetFormat from = DataSetFormat::graupel;
  std::map<std::string, SplitFigures> splits;
  int64_t with_obstacles = 0;      ///< trajectories whose obstacles the output has no place for
  double connectivity_radius = 0;  ///< [m]
  std::optional<Scene> scene;      ///< the first that was made, where the output is ours
};

/// Writes the data set with metadata.json (statistics of the training split, else of the first there is) and
/// dataset.json (where it comes from). The folder is made aside and renamed at the end: nothing is left when it fails.
/// Throws InputError for bad input, ConfigError for flags that do not fit it, IoError.
ConversionResult convert_data_set(const ConversionOptions& options);

}  // namespace graupel::io
