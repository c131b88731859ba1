// Rolls out a graph network on an own mesh: water on an octahedron. own_mesh_rollout models/hgn.safetensors
#include <graupel/graph.h>
#include <graupel/io.h>

#include <cmath>
#include <cstdio>
#include <fstream>

using namespace graupel;

int main(int argc, char** argv) try {
  // Radius 1, closed, triangles counter-clockwise seen from outside.
  std::ofstream("octahedron.obj") << "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n"
                                     "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
  const double radius = 0.16;
  const Vec3d center = {0.5, 0.25, 0.5};
  const Scene scene = io::parse_scene(R"({
    "name": "octahedron", "domain": { "size": [1, 1, 1], "dx": 0.015625 }, "frames": 60,
    "materials": { "water": { "preset": "taichi_water" } },
    "sources": [ { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5], "material": "water" } ],
    "obstacles": [ { "shape": "mesh", "file": "octahedron.obj", "scale": 0.16, "position": [0.5, 0.25, 0.5] } ]
  })",
                                      "example", ".");
  const NetworkModel network(argc > 1 ? argv[1] : "models/hgn.safetensors");
  for (const std::string& remark : network.remarks(scene)) std::printf("note: %s\n", remark.c_str());
  const Trajectory run = network.rollout(scene, {.progress = [](int64_t frame) {
                                           if (frame % 20 == 0)
                                             std::printf("frame %lld\n", static_cast<long long>(frame));
                                         }});
  double deepest = 0;  // of all frames: how far inside |x| + |y| + |z| < radius, along the faces' normals [m]
  for (const ParticleFrame& frame : run.frames)
    for (const Vec3f& p : frame.position) {
      const Vec3d x = p.cast<double>() - center;
      deepest = std::fmax(deepest, (radius - std::abs(x[0]) - std::abs(x[1]) - std::abs(x[2])) / std::sqrt(3.0));
    }
  double mean = 0;
  for (const Vec3f& p : run.frames.back().position) mean += p[1] / static_cast<double>(run.particle_count());
  std::printf("%zu particles after %zu frames: mean height %.3f m, never deeper in the mesh than %.4f m\n",
              run.particle_count(), run.frame_count() - 1, mean, deepest);
  return run.diverged_at_frame < 0 && mean < 0.2 && deepest < scene.domain.dx / 4 ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return static_cast<int>(error.code());
}
