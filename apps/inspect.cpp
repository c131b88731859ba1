// graupel inspect: what is in a scene, a sweep, a trajectory, a saved state, a weights file, a .vdb grid or folders of
// training runs; recovers a trajectory after a kill.
#include <memory>

#include "apps/verbs.h"
#include "experiments/inspection/inspect.h"

namespace graupel::apps {

using namespace experiments;

void add_inspect(const Command& app) {
  auto options = std::make_shared<InspectOptions>();
  const Command verb =
      app.command("inspect", "Look into a scene, sweep, trajectory, saved state, weights, .vdb file or training runs");
  verb.option("file", options->files, "A .json, .h5, .safetensors or .vdb file, a saved state; or run folders")
      .required();
  verb.option("--plots", options->plots, "Plot what training runs measured over time, into this folder (.svg)");
  verb.flag("--recover", options->recover,
            "Make FILE from FILE.part, which a killed run left: every frame whose checksums pass");
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel inspect models/hgn.safetensors\n  graupel inspect --recover steps.h5\n"
      "  graupel inspect runs/hgn runs/gns --plots curves");
  verb.callback([options] { inspect(*options); });
}

}  // namespace graupel::apps
