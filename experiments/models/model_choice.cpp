#include "experiments/models/model_choice.h"

#include <cstring>
#include <utility>

#include "core/system/error.h"
#include "experiments/models/reduced_model.h"

namespace graupel::experiments {

ModelChoice parse_model(const std::string& word) {
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
    if (is_reduced_model(file))
      throw ConfigError("'" + word + "' asks for a part of a reduced-order model, which has no corrections (allowed: " +
                        "graph networks). Name '" + file + "' alone");
    return {.name = word, .kind = ModelKind::network, .weights = file, .parts = parts};
  }
  return {.name = word, .kind = is_reduced_model(word) ? ModelKind::reduced : ModelKind::network, .weights = word};
}

}  // namespace graupel::experiments
