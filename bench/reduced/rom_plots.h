// Plots of results of 'graupel bench rom': trust against the true error, decay of the modes, errors against settings.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace graupel::bench {

/// Writes into `folder` (made if need be) trust.svg, modes-<name>.svg for every data set, and errors-<setting>.svg for
/// every setting in which results of the same data set differ, the number of samples and the step factor among them;
/// returns the files. `results`: as --json of 'bench rom' writes them. Throws InputError for other JSON.
std::vector<std::string> write_rom_plots(const std::vector<nlohmann::ordered_json>& results, const std::string& folder);

}  // namespace graupel::bench
