// graupel simulate: scene -> MPM trajectory.
#include <memory>

#include "apps/verbs.h"
#include "experiments/simulation/simulate.h"

namespace graupel::apps {

using namespace experiments;

void add_simulate(const Command& app) {
  auto options = std::make_shared<SimulateOptions>();
  const Command verb = app.command("simulate", "Run a scene with the material point method");
  verb.option("scene", options->scene, "Scene file (JSON)").names_file({".json"});
  verb.option("-o,--output", options->output, "Trajectory file; default NAME.h5").names_file({".h5"});
  verb.option("--frames", options->frames, "Frames of the whole run; default the scene's").check(whole_number(0));
  verb.option("--set", options->set, "Change a scene key: --set domain.dx=0.02 (repeatable)").one_value_each();
  verb.option("--precision", options->precision, "f32 or f64")
      .check(one_of({"f32", "f64"}))
      .show_default()
      .remember_in(options->precision_given);
  verb.flag("--no-velocity", options->no_velocity, "Store positions only");
  verb.option("--fields", options->fields,
              "Store these of every frame too: stress,affine,deformation_gradient,plastic");
  verb.flag("--forces", options->forces, "Store the forces on every obstacle and wall too");
  verb.option("--save-state", options->save_state, "Write the whole state to this file at the end, or when stopped")
      .names_file({".state"});
  verb.option("--save-every", options->save_every, "Write it every so many frames as well").check(whole_number(1));
  verb.option("--resume", options->resume, "Go on from this state; the scene file may be left out")
      .names_file({".state"});
  verb.flag("--deterministic", options->deterministic,
            "Same bytes in every run on the same kind of device (all solvers do this)");
  verb.option("--write-obstacles", options->write_obstacles, "Write the obstacles' signed distances to this .vdb file")
      .names_file({".vdb"});
  verb.flag("--dry-run", options->dry_run, "Print particles, grid, substeps, memory, disk and time, then stop");
  verb.flag("--print-defaults", options->print_defaults, "Print every scene key with its default; takes no scene");
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel simulate scenes/shared/water_steps.json -o steps.h5\n"
      "  graupel simulate scenes/shared/water_steps.json -o steps.h5 --save-state steps.state --save-every 50\n"
      "  graupel simulate --resume steps.state --frames 600");
  verb.callback([options] { simulate(*options); });
}

}  // namespace graupel::apps
