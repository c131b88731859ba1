// The step size that a scene asks for.
#pragma once

#include <cstdint>

#include "core/scene/fields.h"

namespace graupel {

enum class StepPolicy {
  adaptive,  ///< the largest stable step: courant * dx / (speeds of particles, sound and scripted bodies)
  fixed      ///< `substeps_per_frame` equal steps
};
template <>
struct EnumWords<StepPolicy> {
  static constexpr std::pair<const char*, StepPolicy> words[] = {{"adaptive", StepPolicy::adaptive},
                                                                 {"fixed", StepPolicy::fixed}};
};

struct TimeStep {
  StepPolicy policy = StepPolicy::adaptive;
  int64_t substeps_per_frame = 54;
  double courant = 0.5;
  double max_step = 1e-2;  ///< [s]
  double min_step = 0;     ///< [s]

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = TimeStep;
    visit(&S::policy,
          FieldInfo{
              .name = "policy", .unit = "", .meaning = "adaptive: from stiffness and speed; fixed: equal substeps"});
    visit(&S::substeps_per_frame, FieldInfo{.name = "substeps_per_frame",
                                            .unit = "",
                                            .meaning = "Substeps of a frame",
                                            .range = Range::between(1, 1e6),
                                            .only_for = "fixed"});
    visit(&S::courant, FieldInfo{.name = "courant",
                                 .unit = "",
                                 .meaning = "Largest share of a cell that a wave or a particle crosses in a step",
                                 .range = {.low = 0, .high = 1, .low_open = true},
                                 .only_for = "adaptive"});
    visit(&S::max_step, FieldInfo{.name = "max_step",
                                  .unit = "s",
                                  .meaning = "Upper limit of the step",
                                  .range = Range::positive(),
                                  .only_for = "adaptive"});
    visit(&S::min_step, FieldInfo{.name = "min_step",
                                  .unit = "s",
                                  .meaning = "Lower limit of the step, kept even where stability asks for less",
                                  .range = Range::not_negative(),
                                  .only_for = "adaptive"});
  }
};

}  // namespace graupel
