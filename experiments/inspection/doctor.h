// What this machine and build give a run, and what makes runs slow here: graupel doctor.
#pragma once

#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::experiments {

struct MachineFact {
  std::string name, value;
};

struct MachineReport {
  std::vector<MachineFact> facts;
  std::vector<std::string> hints;  ///< each says what is slow or missing, the value, and the remedy
};

/// Looks at processor, threads, memory, GPU, libraries and programs; takes 0.3 s, in which all threads compute.
MachineReport examine_machine();

/// Prints the report.
void doctor(CommonOptions& options);

}  // namespace graupel::experiments
