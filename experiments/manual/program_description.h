// All that `graupel` takes: its own commands, and those of the programs that its verbs start.
#pragma once

#include "core/system/command_description.h"

namespace graupel::experiments {

/// `program` called graupel, with the commands of graupel-train and graupel-bench below the verbs that start them and
/// the options of the converter (Python). Of one that is not there the verb stays as it is.
CommandDescription whole_program(CommandDescription program);

}  // namespace graupel::experiments
