// What training runs measured on validation data as they went, for 'graupel inspect' of run folders: tables, and plots
// of several runs over the time that they took.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace graupel::experiments {

/// One validation of a run (docs/reference/metrics.md).
struct Validation {
  double step = 0, seconds = 0;
  double one_step = 0;     ///< one-step error over that of the better baseline; NaN where it was not measured
  double rollout_mse = 0;  ///< [m^2]; NaN where it was not measured
};

struct TrainingCurve {
  std::string name;  ///< the run folder's
  std::vector<Validation> validations;
};

/// Whether `path` is a folder of 'graupel train' with measurements.
bool is_run_folder(const std::string& path);

/// Of metrics.csv in a run folder. Throws InputError for a file that has other columns or no numbers in them.
TrainingCurve read_training_curve(const std::string& run_folder);

nlohmann::ordered_json to_json(const TrainingCurve& curve);

/// Writes one-step.svg and rollout.svg (where any run measured them) into `folder`, which is made if need be; returns
/// the files.
std::vector<std::string> write_training_plots(const std::vector<TrainingCurve>& curves, const std::string& folder);

}  // namespace graupel::experiments
