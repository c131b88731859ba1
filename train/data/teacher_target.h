// Targets of distillation (Hinton, Vinyals and Dean 2015): a network learns from the predictions of another one, the
// teacher, and from the data.
#pragma once

#include "graph/features/feature_rules.h"

namespace graupel::train {

/// Acceleration number i of a batch, of [particles, k]: share * a_teacher + (1 - share) * a_data, both in m/frame^2,
/// normalised as the targets of the network that learns.
struct TeacherTarget {
  graph::Normalization of_teacher, of_target;
  float share;             ///< 0: the data alone
  const float* predicted;  ///< [particles, 3 k] of the teacher, by its normalisation
  float* target;           ///< [particles, 3 k] of the data; changed

  GRAUPEL_HD void operator()(int64_t i) const {
    for (int d = 0; d < 3; ++d) {
      const float real = predicted[3 * i + d] * of_teacher.acceleration_std[d] + of_teacher.acceleration_mean[d];
      const float normalized = (real - of_target.acceleration_mean[d]) / of_target.acceleration_std[d];
      target[3 * i + d] = (1 - share) * target[3 * i + d] + share * normalized;
    }
  }
};

}  // namespace graupel::train
