// Drops a block of jelly on the floor, with a scene made in code, and records it: jelly_block OUTPUT.h5
#include <graupel/io.h>
#include <graupel/mpm.h>

#include <algorithm>
#include <cstdio>

using namespace graupel;

Scene falling_block() {
  Scene scene;
  scene.name = "jelly_block";
  scene.domain.size = {0.5, 0.5, 0.5};  // [m]
  scene.domain.dx = 0.5 / 32;
  scene.materials["jelly"] = *material_preset("jelly");
  Source block;
  block.material = "jelly";
  block.size = {0.12, 0.12, 0.12};
  block.position = {0.25, 0.3, 0.25};
  block.sampling = Sampling::jittered_lattice;
  scene.sources.push_back(block);
  scene.frames = 30;
  return checked_scene(scene);  // every value is checked, as in a scene file
}

double lowest(std::span<const Vec3f> position) {
  return (*std::min_element(position.begin(), position.end(), [](auto& a, auto& b) { return a[1] < b[1]; }))[1];
}

int main(int argc, char** argv) try {
  const Scene scene = falling_block();
  Simulation run(scene);
  io::TrajectoryWriter writer(argc > 1 ? argv[1] : "jelly_block.h5", run.header());
  writer.append(run.frame());
  const double floor = scene.wall_low()[1], start = run.balance().gravitational;
  double deepest = lowest(run.position()), least_lost = 0;
  for (int64_t frame = 1; frame <= scene.frames; ++frame) {
    run.advance_frame();
    writer.append(run.frame());
    const Balance now = run.balance();
    const double gap = lowest(run.position()) - floor, lost = start - now.gravitational - now.kinetic - now.elastic;
    deepest = std::min(deepest, gap);
    least_lost = std::min(least_lost, lost);
    if (frame % 5 == 0)
      std::printf("t = %.2f s: %.3f m above the floor, kinetic %.3f J, elastic %.3f J, lost %.3f J\n", run.time(), gap,
                  now.kinetic, now.elastic, lost);
  }
  writer.finish();
  const bool bounced = deepest >= 0 && deepest < scene.domain.dx && least_lost > -0.01 * run.balance().mass;
  std::printf("%zu particles, %s\n", run.particle_count(), bounced ? "touched the floor, no energy was made" : "WRONG");
  return bounced ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return static_cast<int>(error.code());
}
