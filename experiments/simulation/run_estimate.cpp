#include "experiments/simulation/run_estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/parallel/memory.h"
#include "core/system/human_time.h"
#include "core/system/stop_signal.h"
#include "core/system/stopwatch.h"
#include "experiments/process/progress.h"
#include "experiments/simulation/scene_file_error.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/memory_need.h"

namespace graupel::experiments {

namespace {

/// What is run for an estimate, whatever the scene says.
constexpr int64_t most_substeps = 20;
constexpr double most_seconds = 0.5;

/// The first substeps, which tell memory and time on this machine; `of_frame` are in a frame.
mpm::RunStatistics first_substeps(const Scene& scene, const mpm::SimulationOptions& simulation, int64_t of_frame) {
  Scene probe = scene;
  if (of_frame > most_substeps) {  // the tuned kernels for GPUs take a whole frame at once
    probe.frame_time *= static_cast<double>(most_substeps) / static_cast<double>(of_frame);
    if (probe.time_step.policy != StepPolicy::adaptive) probe.time_step.substeps_per_frame = most_substeps;
  }
  const auto run = mpm::Simulation::create(probe, simulation);
  const Stopwatch watch;
  while (!run->advance_substep() && watch.seconds() < most_seconds) {
  }
  return run->statistics();
}

/// One entry a block of the whole domain, filled or empty [bytes].
double directory_bytes(const mpm::MemoryNeed& empty) { return std::max(empty.host_bytes, empty.device_bytes); }

std::string blocks_text(const Domain& domain, const mpm::MemoryNeed& empty) {
  return fmt::format("{:.3g} grid blocks of 4^{} nodes, {:.0f} bytes each", empty.blocks, domain.axes(),
                     directory_bytes(empty) / empty.blocks);
}

}  // namespace

std::string remark_on_memory(const Scene& scene, const mpm::SimulationOptions& simulation) {
  const mpm::MemoryNeed empty = mpm::least_memory(scene.domain, simulation, 0);
  const double directory = directory_bytes(empty);
  if (directory < 1e9 || directory < 0.8 * directory_bytes(mpm::least_memory(scene, simulation))) return "";
  return fmt::format("the domain takes {} of memory, most of it empty ({}). A smaller domain or a larger dx takes less",
                     human_bytes(directory), blocks_text(scene.domain, empty));
}

void print_run_estimate(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation) {
  const StopPolicyScope nothing_is_lost(StopPolicy::at_once);
  const mpm::Estimate e = naming_file(options.scene_file(), [&] { return mpm::estimate(scene, simulation); });
  const double disk = static_cast<double>(e.particles) * static_cast<double>(scene.frames + 1) *
                      static_cast<double>(io::particle_frame_bytes(options.write_options(scene)));
  std::printf("particles        %lld\ngrid nodes       %lld (active at the start)\nsubsteps         %lld\n",
              static_cast<long long>(e.particles), static_cast<long long>(e.grid_nodes),
              static_cast<long long>(e.substeps));
  const mpm::RunStatistics statistics =
      first_substeps(scene, simulation, e.substeps / std::max<int64_t>(1, scene.frames));
  const double memory = static_cast<double>(statistics.peak_bytes);
  const double per_particle = memory / static_cast<double>(e.particles);
  const double seconds = statistics.solver_seconds / static_cast<double>(std::max<int64_t>(1, statistics.substeps)) *
                         static_cast<double>(e.substeps);
  std::printf("memory           %s on the device (%.0f peak bytes per particle), %s available\n",
              human_bytes(memory).c_str(), per_particle,
              human_bytes(static_cast<double>(available_bytes(simulation.device)) + memory).c_str());
  const mpm::MemoryNeed empty = mpm::least_memory(scene.domain, simulation, 0);
  std::printf("of it the domain %s (%s)\n", human_bytes(directory_bytes(empty)).c_str(),
              blocks_text(scene.domain, empty).c_str());
  std::printf("disk, at most    %s\ntime, about      %s (from %lld substeps on this machine)\n",
              human_bytes(disk).c_str(), human_time(seconds).c_str(), static_cast<long long>(statistics.substeps));
  options.common.write_json({{"particles", e.particles},
                             {"grid_nodes", e.grid_nodes},
                             {"substeps", e.substeps},
                             {"memory_bytes", statistics.peak_bytes},
                             {"peak_bytes_per_particle", per_particle},
                             {"domain_bytes", directory_bytes(empty)},
                             {"disk_bytes", disk},
                             {"seconds", seconds}});
}

}  // namespace graupel::experiments
