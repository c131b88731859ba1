#include "rom/solver/step_control.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "core/system/error.h"

namespace graupel::rom {

double StepControl::median() const {
  if (misfits_.size() < least_memory) return std::numeric_limits<double>::infinity();
  std::vector<double> sorted(misfits_.begin(), misfits_.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

bool StepControl::keep(double misfit, double negligible, double lost) {
  const bool bad = lost > most_lost || (misfit > negligible && misfit > jump * median());
  if (bad && can_halve()) {
    halve();
    return false;
  }
  misfits_.push_back(misfit);
  if (misfits_.size() > memory) misfits_.pop_front();
  good_ = bad ? 0 : good_ + 1;
  return true;
}

void StepControl::halve() {
  GRAUPEL_ASSERT(can_halve());
  ++halvings_;
  good_ = 0;
}

void StepControl::lengthen_if_due() {
  if (halvings_ == 0 || good_ < good_steps) return;
  --halvings_;
  good_ = 0;
}

}  // namespace graupel::rom
