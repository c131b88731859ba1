// Runs a reduced-order model at a parameter of its training, and says how far to trust it.
// reduced_rollout models/nsf-jelly.safetensors
#include <graupel/io.h>
#include <graupel/rom.h>

#include <algorithm>
#include <cstdio>

using namespace graupel;

int main(int argc, char** argv) try {
  const ReducedModel model(argc > 1 ? argv[1] : "models/nsf-jelly.safetensors");
  for (const ReducedParameter& p : model.parameters())
    std::printf("%s, trained from %g to %g %s: %s\n", p.name.c_str(), p.low, p.high, p.unit.c_str(), p.keys[0].c_str());
  // A value between those of the training, at the place that the key names.
  const ReducedParameter& first = model.parameters().front();
  const double value = 0.5 * (first.low + first.high);
  const Scene scene =
      io::parse_scene(io::scene_to_json(model.scene()), "example", ".", {first.keys[0] + "=" + std::to_string(value)});
  ReducedSimulation run(model, scene);
  const std::vector<Vec3f> start(run.position().begin(), run.position().end());
  for (int64_t frame = 0; frame < scene.frames; ++frame) run.advance_frame();
  double moved = 0;
  for (std::size_t i = 0; i < start.size(); ++i) moved = std::max<double>(moved, norm(run.position()[i] - start[i]));
  std::printf("%s = %g %s: %zu particles moved by up to %.3f m in %.2f s; trust %.2f, %s\n", first.name.c_str(), value,
              first.unit.c_str(), run.particle_count(), moved, run.time(), run.trust_number(), run.verdict().c_str());
  return moved > 0.05 && run.verdict() != "do not trust" ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return static_cast<int>(error.code());
}
