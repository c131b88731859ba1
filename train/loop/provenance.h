// What a weights file tells of its training.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "train/data/data_set.h"
#include "train/loop/checkpoint.h"
#include "train/loop/training_loop.h"
#include "train/networks/teacher.h"

namespace graupel::train {

/// The entries "training.*" of a weights file's metadata; `state.seconds` are those of the whole run, `teacher` may be
/// null.
std::map<std::string, std::string> training_provenance(const TrainingOptions& options, const CheckpointState& state,
                                                       const DataSplit& data,
                                                       const std::optional<Validation>& validation,
                                                       const Teacher* teacher);

}  // namespace graupel::train
