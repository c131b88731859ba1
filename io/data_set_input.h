// A data set of any known format, opened for reading.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/data_set_format.h"
#include "io/particle_series.h"
#include "io/simulator_metadata.h"

namespace graupel::io {

struct InputSplit {
  std::string name;  ///< train, valid or test
  std::unique_ptr<SeriesReader> reader;
};

struct DataSetInput {
  DataSetFormat format = DataSetFormat::graupel;
  SimulatorMetadata metadata;      ///< of our own data sets: what their scenes say
  std::vector<InputSplit> splits;  ///< in the order of split_names
  int64_t with_obstacles = 0;      ///< trajectories whose scenes have obstacles that are no particles
};

/// Opens those splits that are `wanted` and there; all for none. `connectivity_radius` [m] replaces that of the
/// metadata. Throws InputError; ConfigError where a wanted split is not there, or the radius is known from nowhere.
DataSetInput open_data_set(const std::string& folder, const std::vector<std::string>& wanted,
                           std::optional<double> connectivity_radius);

}  // namespace graupel::io
