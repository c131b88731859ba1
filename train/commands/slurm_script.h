// A batch script that trains under Slurm and goes on by itself where the time of a job is over.
#pragma once

#include <string>
#include <vector>

namespace graupel::train {

struct SlurmTraining {
  int ranks = 1;
  std::string program;              ///< file of graupel-train
  std::vector<std::string> begin;   ///< words of a new run
  std::vector<std::string> resume;  ///< words that go on with it
  std::string run, folder;          ///< run folder; where relative paths begin
};

/// The training that this process's words name, in its folder. A run that is not new begins by `resume` too.
SlurmTraining slurm_training(int ranks, const std::string& run, const std::vector<std::string>& resume, bool is_new);

/// Slurm sends SIGUSR1 two minutes before the time is over; the training saves and ends with start_again_exit_code; the
/// script then requeues its job, which goes on with the run folder. Needs no accounting.
std::string slurm_training_script(const SlurmTraining& training);

}  // namespace graupel::train
