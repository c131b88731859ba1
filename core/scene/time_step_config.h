// The step size that a scene asks for.
#pragma once

#include <cstdint>

#include "core/scene/fields.h"

namespace graupel {

enum class StepPolicy {
  adaptive,  ///< the largest stable step: courant * dx / (speeds of particles, sound and scripted bodies)
  fixed,     ///< `substeps_per_frame` equal steps
  per_frame  ///< equal steps: `substeps_per_frame`, or more in a frame that begins with particles too fast for them
};
template <>
struct EnumWords<StepPolicy> {
  static constexpr std::pair<const char*, StepPolicy> words[] = {
      {"adaptive", StepPolicy::adaptive}, {"fixed", StepPolicy::fixed}, {"per_frame", StepPolicy::per_frame}};
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
          FieldInfo{"policy", "",
                    "adaptive: from stiffness and speed; fixed: equal substeps; per_frame: equal substeps, at least "
                    "substeps_per_frame, more where particles are fast"});
    visit(
        &S::substeps_per_frame,
        FieldInfo{"substeps_per_frame", "", "Substeps of a frame", Range::between(1, 1e6)}.only_in("fixed per_frame"));
    visit(&S::courant,
          FieldInfo{"courant",
                    "",
                    "Largest share of a cell that a wave or a particle (per_frame: a particle) crosses in a step",
                    {.low = 0, .high = 1, .low_open = true}}
              .only_in("adaptive per_frame"));
    visit(&S::max_step, FieldInfo{"max_step", "s", "Upper limit of the step", Range::positive()}.only_in("adaptive"));
    visit(&S::min_step, FieldInfo{"min_step", "s", "Lower limit of the step, kept even where stability asks for less",
                                  Range::not_negative()}
                            .only_in("adaptive"));
  }
};

}  // namespace graupel
