// graupel inspect: what is in a scene, a recipe, a trajectory, a data set, a saved state, a weights file, a .vdb grid
// or folders of training runs; recovers a trajectory after a kill.
#include <memory>

#include "apps/verbs.h"
#include "experiments/inspection/inspect.h"

namespace graupel::apps {

using namespace experiments;

void add_inspect(const Command& app) {
  auto options = std::make_shared<InspectOptions>();
  const Command verb = app.command(
      "inspect", "Look into a scene, recipe, trajectory, data set, saved state, weights, .vdb file or training runs");
  verb.option("file", options->files,
              "A .json, .h5, .safetensors or .vdb file, a saved state, a data set's folder; or run folders")
      .names_file({".json", ".h5", ".safetensors", ".vdb", ".state", ".part"})
      .names_folder()
      .required();
  verb.option("--plots", options->plots, "Plot what training runs measured over time, into this folder (.svg)")
      .names_folder();
  verb.flag("--recover", options->recover,
            "Make FILE from FILE.part, which a killed run left: every frame whose checksums pass");
  verb.option("-o,--output", options->output, "Of --recover: make this file, and leave FILE.part as it is")
      .names_file({".h5"});
  options->common.add_without_run_to(verb);
  verb.footer(
      "Examples:\n  graupel inspect models/hgn.safetensors\n  graupel inspect --recover steps.h5\n"
      "  graupel inspect --recover /full/steps.h5 -o /tmp/steps.h5\n  graupel inspect data/hgn\n"
      "  graupel inspect runs/hgn runs/gns --plots curves");
  verb.callback([options] { inspect(*options); });
}

}  // namespace graupel::apps
