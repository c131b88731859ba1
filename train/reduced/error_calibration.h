// What is usual for a reduced-order model: it rolls out some of its training runs, and what its frames show of
// themselves there is the measure for other runs (rom/solver/error_indicator.h). A roll-out sees only the start of the
// run and its parameters, so its error is not that of the fit.
#pragma once

#include <string>

#include "rom/reduced_model.h"
#include "train/reduced/nsf_training.h"

namespace graupel::train {

struct CalibrationOptions {
  std::string file;  ///< train.h5 of the data set
  int runs = 4;      ///< at most, spread over those of the file; 0: none
};

/// Sets model.usual and model.usual_error. A run that diverges counts with the frames before.
void calibrate_trust(rom::ReducedModel& model, const CalibrationOptions& options, CalibrationReport& report);

}  // namespace graupel::train
