// graupel rollout: weights + scene (or a trajectory) -> predicted trajectory.
#include <memory>

#include "apps/verbs.h"
#include "experiments/rollout/rollout.h"

namespace graupel::apps {

using namespace experiments;

void add_rollout(const Command& app) {
  auto options = std::make_shared<RolloutOptions>();
  const Command verb = app.command(
      "rollout", "Predict a scene with a learned simulator: a graph network, a reduced-order model or coarse MPM");
  verb.option("weights", options->weights, "Weights file (.safetensors)").names_file({".safetensors"}).required();
  verb.option("input", options->input, "Scene (.json) or trajectory (.h5)").names_file({".json", ".h5"}).required();
  verb.option("-o,--output", options->output, "Trajectory file").names_file({".h5"}).show_default();
  verb.option("--frames", options->frames, "Frames to predict; default the scene's, of truth:N the rest of the input")
      .check(whole_number(0));
  verb.option("--set", options->set, "Change a scene key: --set gravity=[0,-5,0] (repeatable)").one_value_each();
  verb.option("--start", options->start,
              "Of networks. scene: frame 0 with a ballistic past; truth:N: the first N frames of the input. Of a "
              "trajectory the rest is compared with")
      .suggest({"scene", "truth:"})
      .show_default();
  verb.option("--trajectory", options->trajectory, "Which trajectory of a data set")
      .check(whole_number(0))
      .show_default();
  verb.flag("--all", options->all,
            "Of networks: all trajectories of a data set, many at once on a GPU; the output is a data set");
  verb.flag("--no-project", options->no_project, "Of networks: do not move particles out of obstacles");
  verb.flag("--no-free-flight", options->no_free_flight,
            "Of networks: let them change the momentum of what flies freely");
  verb.option("--density-limit", options->density_limit,
              "Of networks: largest density of the matter, of that at rest; default 1, 0: none")
      .check(real_number(0, 10));
  verb.option("--step-factor", options->step_factor, "Of reduced-order models: steps over those of the training")
      .check(real_number(LowerBound::above_zero));
  verb.flag("--f64", options->f64, "Of reduced-order models: double precision");
  verb.option("--projection", options->projection,
              "Of reduced-order models, instead of the model's: position, position_velocity or velocity")
      .check(one_of({"position", "position_velocity", "velocity"}));
  verb.option("--quadrature", options->quadrature,
              "Of reduced-order models, instead of the model's: lagrangian or eulerian")
      .check(one_of({"lagrangian", "eulerian"}));
  verb.option("--refine", options->refine,
              "Of reduced-order models: write so many points in the volume of every particle (positions alone)")
      .check(whole_number(1, 1000000));
  verb.option(
          "--load", options->loads,
          "Of reduced-order models: a force on the matter in a ball, TIME:DURATION:X,Y,Z:RADIUS:FX,FY,FZ in seconds, "
          "metres and newtons (repeatable)")
      .one_value_each();
  verb.option("--stride", options->stride, "Of reduced-order models: write every n-th frame")
      .check(whole_number(1))
      .show_default();
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel rollout models/hgn.safetensors scenes/shared/water_steps.json -o predicted.h5\n"
      "  graupel rollout models/hgn.safetensors steps.h5 --start truth:6 --frames 60\n"
      "  graupel rollout models/hgn.safetensors data/test.h5 --all --device cuda -o predicted.h5\n"
      "  graupel rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --set "
      "materials.sand.friction_angle=33\n"
      "  graupel rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --refine 100 --stride 10");
  verb.callback([options] { rollout(*options); });
}

}  // namespace graupel::apps
