// A small sweep for the tests of reduced-order models: a falling and spreading column of sand at seven angles of
// friction.
#pragma once

#include <unistd.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/system/atomic_file.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"
#include "rom/reduced_solver.h"

namespace graupel::train {

/// A falling and spreading column of sand; its friction angle is varied.
inline Scene column(double angle) {
  return io::parse_scene(R"({
    "name": "column", "domain": { "size": [0.5, 0.5, 0.5], "dx": 0.02, "walls": "stick" },
    "gravity": [0, -4, 0],
    "materials": { "sand": { "preset": "nsf_sand", "friction_angle": 30 } },
    "sources": [ { "shape": "box", "size": [0.08, 0.12, 0.08], "position": [0.25, 0.121, 0.25], "material": "sand" } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 4 },
    "frames": 25, "frame_time": 0.016, "seed": 3 })",
                         "scene", "", {"materials.sand.friction_angle=" + std::to_string(angle)});
}

inline Trajectory run_of(const Scene& scene) {
  const auto simulation = mpm::Simulation::create(scene, {.seed = scene.seed});
  const FieldSet fields = {ParticleField::stress, ParticleField::affine};
  Trajectory trajectory;
  trajectory.particle_type = simulation->particle_type();
  trajectory.frame_time = scene.frame_time;
  trajectory.scene_json = io::scene_to_json(scene);
  trajectory.seed = scene.seed;
  trajectory.frames.push_back(mpm::frame_with_fields(*simulation, fields));
  for (int64_t f = 0; f < scene.frames; ++f) {
    simulation->advance_frame();
    trajectory.frames.push_back(mpm::frame_with_fields(*simulation, fields));
  }
  return trajectory;
}

/// A new folder of this process for the data set `name`, below the build folder; removed with the process.
inline std::string new_sweep_folder(const std::string& name) {
  static struct Folders {
    std::vector<std::string> made;
    ~Folders() {
      for (const std::string& folder : made) remove_path(folder);
    }
  } folders;
  folders.made.push_back(std::string(GRAUPEL_BINARY_DIR) + "/" + name + "_" + std::to_string(::getpid()));
  make_folder(folders.made.back());
  return folders.made.back();
}

/// The folder of the data set `name`.
inline std::string tiny_sweep(const std::string& name) {
  const std::string folder = new_sweep_folder(name);
  std::vector<std::string> parts;
  for (int i = 0; i < 7; ++i) {
    const double angle = 24 + 2 * i;
    const Trajectory run = run_of(column(angle));
    parts.push_back(folder + "/part" + std::to_string(i) + ".h5");
    io::TrajectoryWriteOptions options;
    options.fields = {ParticleField::stress, ParticleField::affine};
    io::TrajectoryWriter writer(parts.back(), run, options);
    writer.parameters({{"friction_angle", "degrees", angle, {"materials.sand.friction_angle"}}});
    for (const ParticleFrame& frame : run.frames) writer.append(frame);
    writer.finish();
  }
  io::merge_trajectories(parts, folder + "/train.h5");
  return folder;
}

/// Root of the sum of squared errors over that of squared displacements, over all frames.
template <typename T>
double displacement_error(const rom::ReducedModel& model, double angle, const rom::ReducedOptions& options) {
  const Scene scene = column(angle);
  const Trajectory truth = run_of(scene);
  rom::ReducedSolver<T> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {angle}, options);
  double error2 = 0, way2 = 0;
  for (std::size_t f = 1; f < truth.frames.size(); ++f) {
    solver.advance_frame();
    const ParticleFrame frame = solver.frame();
    for (std::size_t p = 0; p < frame.position.size(); ++p) {
      error2 += norm2((frame.position[p] - truth.frames[f].position[p]).cast<double>());
      way2 += norm2((truth.frames[f].position[p] - truth.frames[0].position[p]).cast<double>());
    }
  }
  return std::sqrt(error2 / way2);
}

}  // namespace graupel::train
