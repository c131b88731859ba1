#include "experiments/rollout/rollout.h"

#include <fmt/format.h>

#include "core/system/error.h"
#include "core/system/output_files.h"
#include "experiments/models/model_choice.h"
#include "experiments/rollout/coarse_rollout.h"
#include "experiments/rollout/network_rollout.h"
#include "experiments/rollout/reduced_rollout.h"
#include "experiments/rollout/rollout_input.h"
#include "io/trajectory/input_files.h"

namespace graupel::experiments {

namespace {

/// Flags that mean nothing for the kind of input.
void check_flags(const RolloutOptions& options) {
  if (options.input.ends_with(".safetensors"))
    throw ConfigError("'" + options.weights + "' and '" + options.input +
                      "' are in the wrong order (weights come first, then the scene or trajectory). Swap them");
  if (is_trajectory(options.input) && options.common.seed_given)
    throw ConfigError("--seed has no effect on '" + options.input +
                      "' (a trajectory's particles are given; --seed samples a scene's). Leave it out");
  if (!is_trajectory(options.input) && options.trajectory > 0)
    throw ConfigError("--trajectory needs a data set (.h5) as input, not '" + options.input + "'. Leave it out");
  if (options.all && !is_trajectory(options.input))
    throw ConfigError("--all needs a data set (.h5) as input, not '" + options.input + "'. Leave it out");
  if (options.all && options.trajectory > 0)
    throw ConfigError("--all and --trajectory do not go together (--trajectory " + std::to_string(options.trajectory) +
                      " is one of them). Leave one out");
  check_library_output(options.output);
  io::check_inputs_kept({{"the weights", options.weights}, {"the input", options.input}},
                        {{"--output", options.output}, {"--json", options.common.json}}, options.set);
}

/// The first flag given that only reduced-order models know; null where there is none.
const char* flag_of_reduced_models(const RolloutOptions& options) {
  return options.step_factor           ? "--step-factor"
         : options.refine              ? "--refine"
         : options.stride != 1         ? "--stride"
         : options.f64                 ? "--f64"
         : !options.projection.empty() ? "--projection"
         : !options.quadrature.empty() ? "--quadrature"
         : !options.loads.empty()      ? "--load"
                                       : nullptr;
}

/// Flags that the kind of model does not know.
void check_flags_of_network(const RolloutOptions& options) {
  if (const char* flag = flag_of_reduced_models(options))
    throw ConfigError(
        fmt::format("{} is of reduced-order models, and '{}' is a graph network. Leave it out", flag, options.weights));
}

void check_flags_of_reduced_model(const RolloutOptions& options) {
  if (options.all)
    throw ConfigError("--all is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which runs one scene. Leave it out");
  if (options.start != "scene")
    throw ConfigError(fmt::format(
        "--start {} is of graph networks; '{}' is a reduced-order model, which starts with its scene (allowed: scene). "
        "Leave it out",
        options.start, options.weights));
  if (options.no_project)
    throw ConfigError("--no-project is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which moves no particle out of obstacles. Leave it out");
  if (options.no_free_flight)
    throw ConfigError("--no-free-flight is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which changes no momentum. Leave it out");
  if (options.density_limit)
    throw ConfigError("--density-limit is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which keeps the volume of its matter itself. Leave it out");
}

void check_flags_of_coarse_model(const RolloutOptions& options) {
  const char* of_networks = options.start != "scene" ? "--start"
                            : options.all            ? "--all"
                            : options.no_project     ? "--no-project"
                            : options.no_free_flight ? "--no-free-flight"
                            : options.density_limit  ? "--density-limit"
                                                     : nullptr;
  const char* flag = of_networks != nullptr ? of_networks : flag_of_reduced_models(options);
  if (flag != nullptr)
    throw ConfigError(fmt::format("{} is of {}, and '{}' is coarse MPM. Leave it out", flag,
                                  of_networks != nullptr ? "graph networks" : "reduced-order models", options.weights));
}

}  // namespace

void rollout(RolloutOptions& options) {
  check_flags(options);
  const ModelKind kind = kind_of_weights(nn::read_safetensors(options.weights));
  // Learned simulators take the GPU where it is asked for.
  const Device device = options.common.device == "auto" ? Device::cpu : parse_device(options.common.device);
  options.common.apply();
  switch (kind) {
    case ModelKind::coarse:
      check_flags_of_coarse_model(options);
      return rollout_coarse(options, device);
    case ModelKind::reduced:
      check_flags_of_reduced_model(options);
      return rollout_reduced(options);
    default:
      check_flags_of_network(options);
      return rollout_network(options, device);
  }
}

}  // namespace graupel::experiments
