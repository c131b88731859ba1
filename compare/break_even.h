// From how many scenes on a learned model takes less time than MPM: making the data, training and rollouts, against
// runs of MPM alone. Definition: docs/reference/metrics.md, "Break-even".
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/comparison.h"

namespace graupel::compare {

enum class BreakEvenVerdict {
  pays,     ///< from `scenes` on
  later,    ///< at `scenes` or later: the weights tell only one of data and training
  never,    ///< a rollout takes as long as the rival's run, or longer
  unknown,  ///< the weights tell neither
};
const char* name_of(BreakEvenVerdict verdict);

/// A model against one rival.
struct RivalBreakEven {
  std::string rival;         ///< "mpm:coarse:fast", "mpm"
  double rival_seconds = 0;  ///< of one of its runs, mean over BreakEven::scenes [s]
  BreakEvenVerdict verdict = BreakEvenVerdict::unknown;
  std::optional<double> scenes;  ///< whole number
};

struct BreakEven {
  std::string model;
  std::size_t scenes = 0;    ///< in which it and both rivals predicted a frame: others have no times
  double scene_seconds = 0;  ///< of a rollout, mean over them [s]
  OfflineTime offline;
  /// Data or training were timed on other hardware than the rollouts, or on such that is not told.
  bool estimate = false;
  std::vector<RivalBreakEven> rivals;
};

/// n = ceil((data + training) / (rival - model)), times in seconds.
RivalBreakEven break_even(const OfflineTime& offline, double model_seconds, const std::string& rival,
                          double rival_seconds);

/// Of every model with an offline time and such scenes, in the order of models_of; empty without rollouts.
std::vector<BreakEven> break_evens(const Comparison& comparison);

/// "Break-even of hgn.safetensors in time, errors aside: ...".
std::string break_even_sentence(const BreakEven& result, const Comparison& comparison);

}  // namespace graupel::compare
