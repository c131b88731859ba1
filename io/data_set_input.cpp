#include "io/data_set_input.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "io/gns_data_set.h"
#include "io/graupel_data_set.h"
#include "io/lagrangebench_data_set.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

std::vector<std::string> present_splits(const fs::path& folder, DataSetFormat format,
                                        const std::vector<std::string>& wanted) {
  std::vector<std::string> names;
  for (const char* name : split_names) {
    const bool asked = std::find(wanted.begin(), wanted.end(), name) != wanted.end();
    const fs::path file = folder / split_file(format, name);
    if (asked && !fs::is_regular_file(file))
      throw ConfigError("--split " + std::string(name) + " is not in '" + folder.string() + "' (no '" +
                        file.filename().string() + "'). Leave it out");
    if ((asked || wanted.empty()) && fs::is_regular_file(file)) names.push_back(name);
  }
  return names;
}

/// Our own data sets: their scenes say all but the radius of connections.
void open_own(const fs::path& folder, const std::vector<std::string>& names, std::optional<double> radius,
              DataSetInput& input) {
  const fs::path card = folder / "metadata.json";
  std::optional<SimulatorMetadata> written;
  if (fs::is_regular_file(card)) written = read_simulator_metadata(card);
  if (!radius && written) radius = written->connectivity_radius;
  if (!radius)
    throw ConfigError("the radius within which particles are connected is not known ('" + card.string() +
                      "' is not there). Give it: --connectivity-radius 0.035");
  std::optional<SimulatorMetadata> common;
  for (const std::string& name : names) {
    auto split = std::make_unique<GraupelSplit>(folder / split_file(input.format, name), common);
    input.with_obstacles += split->with_obstacles();
    input.splits.push_back({name, std::move(split)});
  }
  input.metadata = *common;
  input.metadata.connectivity_radius = *radius;
  if (written) input.metadata.particle_spacing = written->particle_spacing;
}

void open_foreign(const fs::path& folder, const std::vector<std::string>& names, std::optional<double> radius,
                  DataSetInput& input) {
  input.metadata = read_simulator_metadata(folder / "metadata.json");
  if (radius) input.metadata.connectivity_radius = *radius;
  if (input.metadata.name.empty()) input.metadata.name = fs::absolute(folder).lexically_normal().filename();
  for (const std::string& name : names) {
    const std::string file = folder / split_file(input.format, name);
    input.splits.push_back(
        {name, input.format == DataSetFormat::gns ? open_gns_split(file) : open_lagrangebench_split(file)});
  }
}

}  // namespace

DataSetInput open_data_set(const std::string& folder, const std::vector<std::string>& wanted,
                           std::optional<double> connectivity_radius) {
  DataSetInput input;
  input.format = format_of_folder(folder);
  const auto names = present_splits(folder, input.format, wanted);
  if (input.format == DataSetFormat::graupel)
    open_own(folder, names, connectivity_radius, input);
  else
    open_foreign(folder, names, connectivity_radius, input);
  return input;
}

}  // namespace graupel::io
