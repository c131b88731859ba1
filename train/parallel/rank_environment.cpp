#include "train/parallel/rank_environment.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "core/system/error.h"
#include "core/system/fnv1a.h"

namespace graupel::train {

namespace {

constexpr int64_t torch_port = 29500;  // PyTorch's own default
constexpr const char* loopback = "127.0.0.1";

/// The variables of one launcher.
struct Launcher {
  const char *name, *rank, *size, *local_rank, *local_size;
  bool binds;
};
// A launcher that stands earlier was started inside one that stands later: mpirun starts its helpers by srun.
constexpr Launcher by_rank = {"RANK, WORLD_SIZE", "RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE", false};
constexpr Launcher outer_launchers[] = {
    {"Open MPI", "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_RANK",
     "OMPI_COMM_WORLD_LOCAL_SIZE", true},
    {"MPICH", "PMI_RANK", "PMI_SIZE", "MPI_LOCALRANKID", "MPI_LOCALNRANKS", true},
    // SLURM_NTASKS is set in batch scripts too, where srun has started nothing.
    {"srun", "SLURM_PROCID", "SLURM_STEP_NUM_TASKS", "SLURM_LOCALID", "SLURM_STEP_TASKS_PER_NODE", true}};

std::optional<int64_t> to_number(const std::string& text) {
  int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// A whole number from `low` to `high`; empty where the variable is not set.
std::optional<int64_t> number_of(const Variables& variable, const std::string& name, int64_t low, int64_t high) {
  const auto text = variable(name);
  if (!text) return std::nullopt;
  const auto value = to_number(*text);
  if (!value || *value < low || *value > high)
    throw ConfigError("environment variable " + name + "='" + *text +
                      "' is not usable (allowed here: a whole number, " + std::to_string(low) + " to " +
                      std::to_string(high) +
                      "). The program that starts the ranks sets it; unset it to train in one process");
  return value;
}

constexpr int64_t most_ranks = 1 << 20;

/// Tasks on this node out of Slurm's "2(x3),1".
std::optional<int64_t> slurm_tasks_here(const Variables& variable) {
  const std::string list = variable("SLURM_STEP_TASKS_PER_NODE").value_or("");
  int64_t nodes_left = number_of(variable, "SLURM_NODEID", 0, most_ranks).value_or(0);
  for (std::size_t at = 0; at < list.size();) {
    const std::size_t end = std::min(list.find(',', at), list.size());
    const std::string group = list.substr(at, end - at);
    const std::size_t times = group.find("(x");
    const auto tasks = to_number(group.substr(0, times));
    const auto nodes =
        times == std::string::npos ? 1 : to_number(group.substr(times + 2, group.size() - times - 3)).value_or(1);
    if (tasks && nodes_left < nodes) return tasks;
    nodes_left -= nodes;
    at = end + 1;
  }
  return std::nullopt;
}

/// Rank and numbers of one launcher; empty where it did not start this process.
std::optional<RankEnvironment> read_launcher(const Variables& variable, const Launcher& launcher) {
  const auto size = number_of(variable, launcher.size, 1, most_ranks);
  const auto rank = number_of(variable, launcher.rank, 0, size.value_or(most_ranks) - 1);
  const bool by_slurm = launcher.name == std::string("srun");
  if (!size && by_slurm) return std::nullopt;
  // srun --mpi=pmi2 sets MPICH's rank and size beside its own.
  if (launcher.name == std::string("MPICH") && !variable(launcher.local_rank) && variable("SLURM_STEP_NUM_TASKS"))
    return std::nullopt;
  if (!rank && !size) return std::nullopt;
  if (!rank || !size)
    throw ConfigError(std::string("environment variable ") + (rank ? launcher.size : launcher.rank) + " is missing (" +
                      (rank ? launcher.rank : launcher.size) +
                      " is set, so that this is one of several ranks). Set both or none");
  RankEnvironment environment;
  environment.launcher = launcher.name;
  environment.rank = static_cast<int>(*rank);
  environment.size = static_cast<int>(*size);
  environment.bound = launcher.binds;
  const auto local_size =
      by_slurm ? slurm_tasks_here(variable) : number_of(variable, launcher.local_size, 1, environment.size);
  environment.local_size = static_cast<int>(local_size.value_or(environment.size));
  const auto local_rank = number_of(variable, launcher.local_rank, 0, environment.local_size - 1);
  if (!local_rank && environment.size > 1)
    throw ConfigError(std::string("environment variable ") + launcher.local_rank + " is missing (" + launcher.rank +
                      " and " + launcher.size + " are set). It is the rank among the processes of this machine");
  environment.local_rank = static_cast<int>(local_rank.value_or(0));
  return environment;
}

std::string words_of(const RankEnvironment& environment) {
  return "rank " + std::to_string(environment.rank) + " of " + std::to_string(environment.size) + " by " +
         environment.launcher;
}

/// torchrun may run inside another launcher, one on each machine; then the numbers of ranks are multiples. Else both
/// must agree: RANK is often left over from an earlier run in the same shell.
void check_agreement(const Variables& variable, const RankEnvironment& chosen, const RankEnvironment& other) {
  const bool elastic = variable("TORCHELASTIC_RUN_ID").has_value();
  if (chosen.size == other.size ? elastic || chosen.rank == other.rank : chosen.size % other.size == 0) return;
  throw ConfigError("the environment contradicts itself (" + words_of(chosen) + ", " + words_of(other) +
                    "). Unset RANK and WORLD_SIZE, or the variables of " + other.launcher);
}

/// A port that another run on the machine is unlikely to have; below those that systems hand out by themselves.
int64_t port_from(const std::string& run) {
  return 20000 + static_cast<int64_t>(fnv1a(fnv_start, run.data(), run.size()) % 10000);
}

/// Where MASTER_ADDR and MASTER_PORT do not say where rank 0 listens.
void find_rendezvous(const Variables& variable, RankEnvironment& environment) {
  environment.address = variable("MASTER_ADDR").value_or("");
  int64_t port = number_of(variable, "MASTER_PORT", 1, 65535).value_or(0);
  const bool one_machine = environment.local_size == environment.size;
  if (environment.launcher == by_rank.name && (environment.address.empty() || port == 0))
    throw ConfigError(std::string("environment variable ") + (port == 0 ? "MASTER_PORT" : "MASTER_ADDR") +
                      " is missing (RANK and WORLD_SIZE are set). It says where rank 0 can be reached");
  if (environment.launcher == "srun") {
    const std::string hosts = variable("SLURM_STEP_NODELIST").value_or(variable("SLURM_JOB_NODELIST").value_or(""));
    if (environment.address.empty()) environment.address = one_machine ? loopback : first_host(hosts);
    if (port == 0)
      port = port_from("slurm " + variable("SLURM_JOB_ID").value_or("") + "." + variable("SLURM_STEP_ID").value_or(""));
  }
  if (environment.address.empty() && one_machine) environment.address = loopback;
  if (environment.address.empty())
    throw ConfigError("the machine of rank 0 is not known (" + words_of(environment) + ", " +
                      std::to_string(environment.local_size) +
                      " of them on this machine). Set MASTER_ADDR to its name or address on every machine");
  if (port == 0) {
    const auto run = variable("PMIX_NAMESPACE");
    port = run ? port_from("mpi " + *run) : torch_port;
  }
  environment.port = static_cast<int>(port);
}

}  // namespace

std::optional<std::string> process_variable(const std::string& name) {
  const char* const value = std::getenv(name.c_str());
  return value == nullptr || *value == '\0' ? std::nullopt : std::optional<std::string>(value);
}

RankEnvironment read_rank_environment(const Variables& variable) {
  auto chosen = read_launcher(variable, by_rank);
  for (const Launcher& launcher : outer_launchers) {
    if (chosen && chosen->launcher != by_rank.name) break;
    const auto found = read_launcher(variable, launcher);
    if (!found) continue;
    if (chosen) check_agreement(variable, *chosen, *found);
    if (!chosen) chosen = found;
  }
  RankEnvironment environment = chosen.value_or(RankEnvironment());
  if (environment.alone()) return environment;
  find_rendezvous(variable, environment);
  if (variable("TORCHELASTIC_RUN_ID")) environment.launcher = "torchrun";
  environment.served = variable("TORCHELASTIC_USE_AGENT_STORE").value_or("") == "True";
  environment.restart = static_cast<int>(number_of(variable, "TORCHELASTIC_RESTART_COUNT", 0, 1 << 20).value_or(0));
  return environment;
}

void require_one_process(const std::string& what) {
  const RankEnvironment environment = read_rank_environment();
  if (!environment.alone())
    throw ConfigError(what + " runs in one process (" + words_of(environment) +
                      "). Start it without a launcher of several ranks");
}

int threads_of_rank(const RankEnvironment& environment, int usable, int online) {
  const bool divided = environment.bound && usable * environment.local_size <= online;
  return divided ? usable : std::max(1, usable / environment.local_size);
}

std::string gpu_of_rank(const RankEnvironment& environment, const std::optional<std::string>& visible) {
  if (!visible) return std::to_string(environment.local_rank);
  std::vector<std::string> names;
  for (std::size_t at = 0; at <= visible->size();) {
    const std::size_t end = std::min(visible->find(',', at), visible->size());
    names.push_back(visible->substr(at, end - at));
    at = end + 1;
  }
  if (visible->empty() || (names.size() == 1 && environment.bound)) return *visible;
  if (names.size() < static_cast<std::size_t>(environment.local_size))
    throw ConfigError("there are " + std::to_string(environment.local_size) + " ranks on this machine and " +
                      std::to_string(names.size()) + " GPUs (CUDA_VISIBLE_DEVICES=" + *visible +
                      "). Start one rank for a GPU");
  return names[static_cast<std::size_t>(environment.local_rank)];
}

std::string first_host(const std::string& list) {
  std::string host;
  for (std::size_t at = 0; at < list.size() && list[at] != ','; ++at) {
    if (list[at] != '[') {
      host += list[at];
      continue;
    }
    const std::size_t close = std::min(list.find(']', at), list.size());
    host += list.substr(at + 1, std::min(list.find_first_of("-,", at + 1), close) - at - 1);
    at = close;
  }
  return host;
}

}  // namespace graupel::train
