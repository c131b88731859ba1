#include "experiments/models/model_choice.h"

#include <cstring>
#include <utility>

#include "core/system/error.h"
#include "hybrid/coarse_model.h"
#include "rom/reduced_model.h"

namespace graupel::experiments {

compare::ModelRole role_of(ModelKind kind) {
  if (kind == ModelKind::mpm) return compare::ModelRole::mpm;
  return kind == ModelKind::reduced ? compare::ModelRole::reduced : compare::ModelRole::learned;
}

ModelKind kind_of_weights(const nn::Weights& weights) {
  if (hybrid::is_coarse_model(weights)) return ModelKind::coarse;
  return rom::is_reduced_model(weights) ? ModelKind::reduced : ModelKind::network;
}

ModelChoice parse_model(const std::string& word, std::span<const ModelChoice> before) {
  const auto choice_of = [&](const std::string& file, NetworkParts parts) {
    ModelChoice choice{.name = word, .weights = file, .parts = parts};
    for (const ModelChoice& other : before)
      if (other.weights == file) choice.contents = other.contents;
    if (!choice.contents) choice.contents = std::make_shared<const nn::Weights>(nn::read_safetensors(file));
    choice.kind = kind_of_weights(*choice.contents);
    return choice;
  };
  if (const auto variant = mpm::parse_variant(word)) return {word, ModelKind::mpm, *variant};
  if (word.starts_with("mpm:"))
    throw ConfigError("unknown model '" + word + "' (allowed: " + mpm::variant_words() +
                      ", corrections-only or a weights file). Correct --models");
  if (word == "corrections-only")
    return {.name = word, .kind = ModelKind::network, .parts = NetworkParts::corrections_alone};
  for (const auto& [suffix, parts] : {std::pair{":no-corrections", NetworkParts::network_alone},
                                      std::pair{":corrections-only", NetworkParts::corrections_alone}}) {
    if (!word.ends_with(suffix)) continue;
    const std::string file = word.substr(0, word.size() - std::strlen(suffix));
    ModelChoice choice = choice_of(file, parts);
    if (choice.kind != ModelKind::network)
      throw ConfigError("'" + word +
                        "' asks for a part of a model that has no corrections (allowed: graph networks). " + "Name '" +
                        file + "' alone");
    return choice;
  }
  if (word.ends_with(no_pull_suffix)) {
    const std::string file = word.substr(0, word.size() - std::strlen(no_pull_suffix));
    ModelChoice choice = choice_of(file, NetworkParts::all);
    if (choice.kind != ModelKind::reduced)
      throw ConfigError("'" + word + "' asks for a model without its pull to training runs (allowed: reduced-order " +
                        "models). Name '" + file + "' alone");
    choice.pull = Pull::none;
    return choice;
  }
  return choice_of(word, NetworkParts::all);
}

}  // namespace graupel::experiments
