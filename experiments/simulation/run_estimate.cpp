#include "experiments/simulation/run_estimate.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/parallel/memory.h"
#include "core/system/human_time.h"
#include "core/system/stop_signal.h"
#include "experiments/process/progress.h"
#include "experiments/simulation/scene_file_error.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

/// Substeps that are run for an estimate, so that it takes seconds whatever the scene says.
static constexpr int64_t most_probed = 50;

void print_run_estimate(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation) {
  release_stop_signals();
  const mpm::Estimate e = naming_file(options.scene_file(), [&] { return mpm::estimate(scene, simulation); });
  const double disk = static_cast<double>(e.particles) * static_cast<double>(scene.frames + 1) *
                      static_cast<double>(io::particle_frame_bytes(options.write_options(scene)));
  std::printf("particles        %lld\ngrid nodes       %lld (active at the start)\nsubsteps         %lld\n",
              static_cast<long long>(e.particles), static_cast<long long>(e.grid_nodes),
              static_cast<long long>(e.substeps));
  // Memory and time are measured on this machine: the first substeps of the real scene.
  Scene probe = scene;
  probe.frames = 1;
  const int64_t of_frame = e.substeps / std::max<int64_t>(1, scene.frames);
  if (of_frame > most_probed) {
    probe.frame_time *= static_cast<double>(most_probed) / static_cast<double>(of_frame);
    if (probe.time_step.policy != StepPolicy::adaptive) probe.time_step.substeps_per_frame = most_probed;
  }
  auto run = mpm::Simulation::create(probe, simulation);
  run->advance_frame();
  const auto statistics = run->statistics();
  const double memory = static_cast<double>(statistics.peak_bytes);
  const double per_particle = memory / static_cast<double>(e.particles);
  const double seconds = statistics.solver_seconds / static_cast<double>(std::max<int64_t>(1, statistics.substeps)) *
                         static_cast<double>(e.substeps);
  std::printf("memory           %s on the device (%.0f peak bytes per particle), %s available\n",
              human_bytes(memory).c_str(), per_particle,
              human_bytes(static_cast<double>(available_bytes(simulation.device)) + memory).c_str());
  std::printf("disk, at most    %s\ntime, about      %s (from the first substeps on this machine)\n",
              human_bytes(disk).c_str(), human_time(seconds).c_str());
  options.common.write_json({{"particles", e.particles},
                             {"grid_nodes", e.grid_nodes},
                             {"substeps", e.substeps},
                             {"memory_bytes", statistics.peak_bytes},
                             {"peak_bytes_per_particle", per_particle},
                             {"disk_bytes", disk},
                             {"seconds", seconds}});
}

}  // namespace graupel::experiments
