// A shell script that submits a data set to Slurm: a job array, and after it the job that finishes the set.
#pragma once

#include <string>
#include <vector>

namespace graupel::experiments {

/// `words`: argv of a 'graupel generate' without --emit-slurm and --shard; `program`: its file; `folder`: where
/// relative paths begin. The script needs sbatch alone, no accounting. Its own arguments go to sbatch.
std::string slurm_array_script(const std::string& program, const std::vector<std::string>& words,
                               const std::string& folder, int tasks);

}  // namespace graupel::experiments
