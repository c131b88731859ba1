// What is usual for a reduced-order model: it rolls out some of its training runs, and what its frames show of
// themselves there is the measure for other runs (rom/solver/error_indicator.h). A roll-out sees only the start of the
// run and its parameters, so its error is not that of the fit.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "rom/reduced_model.h"

namespace graupel::train {

struct CalibrationOptions {
  std::string file;  ///< train.h5 of the data set
  int runs = 4;      ///< at most, spread over those of the file; 0: none
  std::function<void(const std::string&)> message = {};
};

struct CalibrationReport {
  int runs = 0, diverged = 0;
  double seconds = 0;
  std::vector<double> errors;  ///< displacement-relative, of each run that did not diverge
};

/// Sets model.usual, model.usual_error and, where the runs can be interpolated, model.interpolation. A run that
/// diverges counts with the frames before and an error of 1, and no bound of interpolation is kept beside it. Data of
/// another machine may lack the meshes that its scenes name: then there is a message, and no verdict on trust.
void calibrate_trust(rom::ReducedModel& model, const CalibrationOptions& options, CalibrationReport& report);

}  // namespace graupel::train
