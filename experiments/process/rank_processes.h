// Several processes of one program on this machine, the ranks of a run: started together, ended together.
#pragma once

#include <string>
#include <vector>

namespace graupel::experiments {

struct RankProcesses {
  std::string program;                 ///< path
  std::vector<std::string> arguments;  ///< of every rank
  int count = 1;
  double grace = 15;  ///< [s] that ranks have to end once another has failed
};

/// Runs all ranks to their end. Each finds its place in RANK, WORLD_SIZE, LOCAL_RANK, LOCAL_WORLD_SIZE, MASTER_ADDR and
/// MASTER_PORT; lines of ranks above 0 carry their number. SIGINT, SIGTERM and SIGUSR1 go on to every rank; when a rank
/// fails the others get SIGTERM, and SIGKILL after `grace`. Returns the exit code of the rank that failed first, or of
/// the first that gave a reason other than another rank's end (128 + n for signal n), 130 for an interrupted run, 75
/// after SIGUSR1, else 0. Throws Error when a process cannot be started.
int run_rank_processes(const RankProcesses& ranks);

}  // namespace graupel::experiments
