// What a word of --models means: MPM and its cheaper variants, graph networks, reduced-order models and coarse MPM with
// trained constants.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "compare/comparison.h"
#include "mpm/scene_variants.h"
#include "nn/weights.h"

namespace graupel::experiments {

enum class ModelKind { mpm, network, reduced, coarse };  ///< coarse: MPM on a coarse grid with trained constants

/// What a comparison calls it.
compare::ModelRole role_of(ModelKind kind);

ModelKind kind_of_weights(const nn::Weights& weights);

/// A network with the laws that its rollouts are held to, or one of the two alone.
enum class NetworkParts { all, network_alone, corrections_alone };

/// Whether the steps of a reduced-order model go part of the way to its training runs (manifold_pull), which draws a
/// rollout towards the line between them.
enum class Pull { as_trained, none };

/// One parsed entry of --models.
struct ModelChoice {
  std::string name;  ///< as given
  ModelKind kind = ModelKind::mpm;
  mpm::SolverVariant variant = {};
  std::string label = "";    ///< short, and unlike those of the other models
  std::string weights = "";  ///< file; empty for MPM, and for corrections-only until it has a network's settings
  NetworkParts parts = NetworkParts::all;
  Pull pull = Pull::as_trained;
  std::shared_ptr<const nn::Weights> contents = nullptr;  ///< of the file
};
/// "mpm", "mpm:...", a weights file, "WEIGHTS:no-corrections", "WEIGHTS:corrections-only", "WEIGHTS:no-pull", or
/// "corrections-only". Throws ConfigError for an unknown "mpm:..." word and for parts of a model without them,
/// InputError for a weights file that cannot be read. Files of the entries `before` are not read again.
ModelChoice parse_model(const std::string& word, std::span<const ModelChoice> before = {});
/// Suffix of a reduced-order model without its pull.
inline constexpr const char* no_pull_suffix = ":no-pull";

}  // namespace graupel::experiments
