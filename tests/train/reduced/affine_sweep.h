// A sweep of prescribed motions with their deformation gradients, for tests of models of the deformation alone.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/math/mat.h"
#include "tests/train/reduced/tiny_sweep.h"

namespace graupel::train {

/// A jelly box that is sheared and stretched by an amount that grows with time, as no forces would do it:
/// x = c + A (X - c).
inline constexpr int motion_frames = 12;
inline const Vec3d center = {0.25, 0.25, 0.25};
inline Mat3d map_at(double size, int frame) {
  const double s = size * frame / motion_frames;
  Mat3d map = Mat3d::identity();
  map(0, 0) += 0.4 * s;
  map(0, 1) += 0.8 * s;
  map(2, 2) -= 0.3 * s;
  return map;
}

/// The folder of the data set `name`: train.h5 and test.h5.
inline std::string affine_sweep(const std::string& name, const std::string& transfer = "pic") {
  const std::string folder = new_sweep_folder(name);
  const Scene scene = io::parse_scene(R"({
    "domain": { "size": [0.5, 0.5, 0.5], "dx": 0.02 }, "materials": { "solid": { "preset": "crom_solid" } },
    "sources": [ { "shape": "box", "size": [0.12, 0.08, 0.08], "position": [0.25, 0.25, 0.25], "material": "solid",
                   "particles_per_cell": 2 } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 1 },
    "frames": 12, "frame_time": 0.01, "seed": 3 })",
                                      "scene", "", {"transfer.scheme=" + transfer});
  const auto simulation = mpm::Simulation::create(scene, {.seed = scene.seed});
  for (const auto& [file, sizes] : {std::pair("train.h5", std::vector<double>{0.2, 0.5, 0.8, 1.1}),
                                    std::pair("test.h5", std::vector<double>{0.65})}) {
    std::vector<std::string> parts;
    for (const double size : sizes) {
      Trajectory run;
      run.particle_type = simulation->particle_type();
      run.frame_time = scene.frame_time;
      run.scene_json = io::scene_to_json(scene);
      run.seed = scene.seed;
      const ParticleFrame start = mpm::frame_with_fields(*simulation, {ParticleField::deformation_gradient});
      for (int f = 0; f <= motion_frames; ++f) {
        ParticleFrame frame = start;
        frame.time = f * scene.frame_time;
        const Mat3d map = map_at(size, f);
        std::vector<float>& gradient = frame.fields[ParticleField::deformation_gradient];
        for (std::size_t p = 0; p < frame.position.size(); ++p) {
          frame.position[p] = (center + map * (start.position[p].cast<double>() - center)).cast<float>();
          for (int i = 0; i < 9; ++i)
            gradient[9 * p + static_cast<std::size_t>(i)] = static_cast<float>(map(i / 3, i % 3));
        }
        run.frames.push_back(frame);
      }
      parts.push_back(folder + "/part" + std::to_string(parts.size()) + file);
      io::TrajectoryWriteOptions options;
      options.fields = {ParticleField::deformation_gradient};
      io::TrajectoryWriter writer(parts.back(), run, options);
      writer.parameters({{"gravity", "m/s^2", size, {"gravity.1"}}});
      for (const ParticleFrame& frame : run.frames) writer.append(frame);
      writer.finish();
    }
    io::merge_trajectories(parts, folder + "/" + file);
  }
  return folder;
}

}  // namespace graupel::train
