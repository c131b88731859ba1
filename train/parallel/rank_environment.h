// Which process of a run this one is, as the program that started it says in environment variables: torchrun and
// `graupel launch` (RANK, WORLD_SIZE ...), srun, Open MPI's mpirun and MPICH's mpiexec.
#pragma once

#include <functional>
#include <optional>
#include <string>

namespace graupel::train {

struct RankEnvironment {
  std::string launcher;  ///< "torchrun", "Open MPI", "MPICH", "srun", else "RANK, WORLD_SIZE"; empty: one process
  int rank = 0, size = 1;
  int local_rank = 0, local_size = 1;  ///< among the processes of this machine
  std::string address;                 ///< machine of rank 0
  int port = 0;                        ///< where rank 0 listens
  bool served = false;                 ///< torchrun itself listens there: rank 0 must not
  int restart = 0;                     ///< how often torchrun has started the run anew
  bool bound = false;                  ///< the launcher may have given each process cores of its own

  bool alone() const { return size == 1; }
};

/// Value of an environment variable, empty where it is not set.
using Variables = std::function<std::optional<std::string>(const std::string& name)>;
std::optional<std::string> process_variable(const std::string& name);

/// Throws ConfigError for variables that are incomplete, no numbers, out of range or contradict each other.
RankEnvironment read_rank_environment(const Variables& variable = process_variable);

/// Throws ConfigError where this process is one of several: `what` runs in one.
void require_one_process(const std::string& what);

/// CPU threads of this process where none are asked for: its part of the cores it may use, out of the `online` ones of
/// the machine. Cores that the launcher has divided already are not divided again.
int threads_of_rank(const RankEnvironment& environment, int usable, int online);

/// What CUDA_VISIBLE_DEVICES must be so that this process sees its own GPU alone; `visible` is its present value. A
/// single GPU that the launcher chose stays. Throws ConfigError where it names fewer GPUs than this machine has ranks.
std::string gpu_of_rank(const RankEnvironment& environment, const std::optional<std::string>& visible);

/// First host of a Slurm list: "node[03-05,9],login" gives "node03".
std::string first_host(const std::string& list);

}  // namespace graupel::train
