// Steps of a reduced run that are longer than those of the training: one whose inversion leaves much more than usual is
// taken back and repeated at half the length; after some good steps the length is doubled again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace graupel::rom {

class StepControl {
 public:
  /// A step may be halved `most_halvings` times; 0: every step is kept.
  explicit StepControl(int most_halvings) : most_halvings_(most_halvings) {}

  /// The wanted step, and the present one, in shortest steps.
  int64_t longest() const { return int64_t(1) << most_halvings_; }
  int64_t length() const { return longest() >> halvings_; }
  bool can_halve() const { return halvings_ < most_halvings_; }
  /// After a step: `misfit` is the distance that its inversion left, over dt [m/s], of which less than `negligible`
  /// never counts; `lost` is the share of samples that moved over a cell. False: the step is to be taken back, and
  /// length() is half of what it was.
  bool keep(double misfit, double negligible, double lost);
  /// A step that failed; call only where can_halve().
  void halve();
  /// Where a step of twice the length would start like the wanted ones.
  void lengthen_if_due();

 private:
  static constexpr double jump = 2.5;  ///< over the median of the misfits of kept steps
  static constexpr double most_lost = 0.05;
  static constexpr std::size_t memory = 16;  ///< kept steps that the median is of
  static constexpr std::size_t least_memory = 4;
  static constexpr int good_steps = 6;  ///< before a longer one is tried

  double median() const;

  int most_halvings_, halvings_ = 0, good_ = 0;
  std::deque<double> misfits_;
};

}  // namespace graupel::rom
