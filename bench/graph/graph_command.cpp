// graupel-bench graph: time of a frame of graph networks beside that of MPM.
#include <memory>

#include "bench/commands.h"
#include "bench/graph/graph_table.h"
#include "mpm/scene_variants.h"

namespace graupel::bench {

using namespace experiments;

void add_graph(const Command& program) {
  auto options = std::make_shared<BenchGraphOptions>();
  const Command verb = program.command("graph", "Time of a frame of graph networks beside MPM's, by size");
  verb.option("--models", options->models, mpm::variant_words() + ", weights of graph networks; comma-separated")
      .suggest(mpm::variant_list())
      .names_file({".safetensors"})
      .delimiter(',')
      .show_default();
  verb.option("--particles", options->particles, "About so many: the recipe's scene, with a larger floor")
      .check(whole_number(100, 100000000))
      .show_default();
  verb.option("--recipe", options->recipe, "Recipe of the scenes").names_file({".json"}).show_default();
  verb.option("--frames", options->frames, "Frames to time (median)").check(whole_number(1)).show_default();
  verb.option("--settle", options->settle, "Frames of MPM before the settled state")
      .check(whole_number(1))
      .show_default();
  verb.option("--batch", options->batch,
              "Time so many such scenes at once, too, each sampled by a seed of its own: MPM, and on a GPU networks")
      .check(whole_number(2, 4096));
  verb.flag("--libtorch", options->libtorch, "Time each network in libtorch too, by graupel-train");
  options->common.add_to(verb);
  verb.footer(
      "Two states of each scene: as it starts to fall, and after --settle frames, at rest. Times are medians a frame; "
      "what\na network that predicts several frames at once spends on them, and MPM on several scenes, is spread over "
      "these.\nA network's time on several scenes is the GPU's; beside it is the caller's clock over whole rollouts of "
      "--frames and\nof ten times as many, with all that starts and results take.\nGFLOP/s: matrix products of the "
      "frame in the middle of the run, beside the rate of products alone: of a "
      "GPU the peak in\nbf16, of the CPU that of the engine's layers with rows in the cache, measured first. "
      "--libtorch "
      "times that frame's\nnetwork alone, features and grid given: as the papers write it, in libtorch's own "
      "operations, and with the first\nlayers split as Graupel's engine has them.\n\n"
      "Examples:\n  graupel bench graph --particles 3600 40000 --json graph.json\n"
      "  graupel bench graph --libtorch --models models/hgn.safetensors\n"
      "  graupel bench graph --device cuda --particles 3600 40000 1000000\n"
      "  graupel bench graph --device cuda --models models/hgn.safetensors --batch 8 64 1024");
  verb.callback([options] { print_graph_table(*options); });
}

}  // namespace graupel::bench
