// MPM speed: one cube of material falling and then on the floor, 8 particles a cell, dx = 1/256.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "bench/micro/micro.h"
#include "core/scene/scene.h"
#include "mpm/simulation.h"

namespace graupel::bench {

namespace {

/// A cube of `cells` cells a side, 8 jittered particles a cell, 6 cells above the floor of a box twice as wide.
Scene cube_scene(const std::string& preset, int64_t cells) {
  Scene scene;
  scene.name = preset;
  scene.domain.dx = 1.0 / 256;
  const double side = static_cast<double>(cells) * scene.domain.dx;
  const double width = std::max(2 * side, 32 * scene.domain.dx);
  scene.domain.size = {width, width, width};
  MaterialConfig material = *material_preset(preset);
  material.name = preset;
  scene.materials[preset] = material;
  Source source;
  source.material = preset;
  source.sampling = Sampling::jittered_lattice;
  source.size = {side, side, side};
  source.position = {width / 2, 9 * scene.domain.dx + side / 2, width / 2};
  scene.sources.push_back(source);
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = 25;
  scene.frame_time = 25 * 5e-5;
  return scene;
}

}  // namespace

nlohmann::ordered_json run_mpm(Device device, const std::vector<int64_t>& cells_per_side) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::printf("%-14s %-4s %10s %8s %12s %14s\n", "material", "type", "particles", "threads", "us/substep",
              "M updates/s");
  for (const char* preset : {"taichi_water", "taichi_jelly", "taichi_snow", "taichi_sand"})
    for (const int64_t cells : cells_per_side)
      for (const mpm::Precision precision : {mpm::Precision::f32, mpm::Precision::f64}) {
        if (device == Device::cuda && precision == mpm::Precision::f64) continue;
        const Scene scene = cube_scene(preset, cells);
        mpm::SimulationOptions options;
        options.device = device;
        options.precision = precision;
        auto run = mpm::Simulation::create(scene, options);
        for (int f = 0; f < 4; ++f) run->advance_frame();  // warm-up
        std::vector<double> seconds;
        for (int f = 0; f < 8; ++f) {
          const double before = run->statistics().solver_seconds;
          run->advance_frame();
          seconds.push_back((run->statistics().solver_seconds - before) /
                            static_cast<double>(scene.time_step.substeps_per_frame));
        }
        const double substep = median(seconds);
        const double updates = static_cast<double>(run->particle_count()) / substep;
        const char* type = precision == mpm::Precision::f32 ? "f32" : "f64";
        const int threads = device == Device::cpu ? num_threads() : 0;
        std::printf("%-14s %-4s %10zu %8d %12.1f %14.2f\n", preset, type, run->particle_count(), threads, 1e6 * substep,
                    1e-6 * updates);
        std::fflush(stdout);
        rows.push_back({{"material", preset},
                        {"precision", type},
                        {"particles", run->particle_count()},
                        {"device", name_of(device)},
                        {"threads", threads},
                        {"seconds_per_substep", substep},
                        {"updates_per_second", updates},
                        {"bytes_per_particle", static_cast<double>(run->statistics().peak_bytes) /
                                                   static_cast<double>(run->particle_count())}});
      }
  return rows;
}

}  // namespace graupel::bench
