// graupel view: trajectories and running scenes in a page of the browser.
#include <memory>

#include "apps/verbs.h"
#include "experiments/viewer/view.h"

namespace graupel::apps {

using namespace experiments;

void add_view(const Command& app) {
  auto options = std::make_shared<ViewOptions>();
  const Command verb = app.command("view", "Look at trajectories, and at scenes while they run, in a browser");
  verb.option("files", options->files, "One file, or two side by side: trajectories (.h5), scenes to run (.json)")
      .names_file({".h5", ".json"})
      .required();
  verb.option("--port", options->port, "Of the page on this machine; default a free one").check(whole_number(1, 65535));
  verb.option("--trajectory", options->trajectory, "Which trajectory of a data set")
      .check(whole_number(0))
      .show_default();
  verb.option("--set", options->set, "Change a key of the scene that is run: --set domain.dx=0.02 (repeatable)")
      .one_value_each();
  options->common.add_to(verb);
  verb.footer(
      "Prints the page's address. The page is served to this machine alone, and only with the secret word in the "
      "address.\nCtrl-C ends it.\n"
      "Examples:\n  graupel view steps.h5\n"
      "  graupel view steps.h5 predicted.h5\n"
      "  graupel view scenes/shared/water_steps.json");
  verb.callback([options] { view(*options); });
}

}  // namespace graupel::apps
