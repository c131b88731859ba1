// graupel demo: shared scenes through MPM and the shipped weights; table on the terminal and report.html.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "apps/verbs.h"
#include "core/system/error.h"
#include "core/system/installed_folder.h"
#include "experiments/comparison/compare_runs.h"
#include "experiments/process/common_options.h"
#include "experiments/process/process.h"

namespace graupel::apps {

using namespace experiments;

namespace {

namespace fs = std::filesystem;

/// Of the floors that the repository holds for the demo: scenes/floors/demo.json.
constexpr int64_t measured_frames = 120;

struct DemoOptions {
  CommonOptions common;
  std::string output = "report.html", scenes = or_installed("scenes/shared"), models = or_installed("models");
  int64_t frames = measured_frames;
};

/// The shipped reduced-order model, and the scene that it is for.
void add_reduced_model(const DemoOptions& options, CompareOptions& compare) {
  const fs::path weights = fs::path(options.models) / "nsf-sand.safetensors";
  if (!fs::exists(weights)) return;
  compare.scenes.push_back(fs::path(options.scenes) / "sand_column.json");
  compare.models.push_back(weights);
  compare.other_scenes = OtherScenes::leave_out;
}

void demo(const DemoOptions& options) {
  const fs::path folder = options.models, coarse = folder / "coarse-mpm.safetensors", hgn = folder / "hgn.safetensors";
  for (const fs::path& weights : {coarse, hgn})
    if (!fs::exists(weights))
      throw InputError("'" + weights.string() + "' is not there. Name the folder of the shipped weights with --models");
  CompareOptions compare;
  compare.scenes = {fs::path(options.scenes) / "mixed_blocks.json", fs::path(options.scenes) / "water_steps.json"};
  compare.models = {"mpm", "mpm:coarse:fast", coarse, hgn};
  add_reduced_model(options, compare);
  compare.frames = options.frames;
  const fs::path floors = fs::path(options.scenes).parent_path() / "floors" / "demo.json";
  if (options.frames == measured_frames && !options.common.seed_given && fs::exists(floors))
    compare.floor_file = floors;
  if (options.common.seed_given) compare.seed = options.common.seed;
  compare.device = options.common.device;
  compare.threads = options.common.threads;
  compare.json = options.common.json;
  compare.report = options.output;
  compare.command = command_line();
  run_compare(compare);
  std::printf("\nOpen %s in a browser for pictures, curves and the particle player.\n",
              fs::absolute(options.output).c_str());
}

}  // namespace

void add_demo(const Command& app) {
  auto options = std::make_shared<DemoOptions>();
  const Command verb = app.command("demo", "Shared scenes through MPM and the shipped weights, on the CPU");
  verb.option("-o,--output", options->output, "Report to write").names_file({".html"}).show_default();
  verb.option("--frames", options->frames, "Frames of each scene").check(whole_number(1)).show_default();
  verb.option("--scenes", options->scenes, "Folder of the shared scenes").names_folder().show_default();
  verb.option("--models", options->models, "Folder of the shipped weights").names_folder().show_default();
  options->common.add_to(verb);
  verb.footer("Examples:\n  graupel demo\n  graupel demo --frames 300 -o long.html");
  verb.callback([options] { demo(*options); });
}

}  // namespace graupel::apps
