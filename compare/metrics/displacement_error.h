// Errors of a run at the truth's particles, over all of them (that are in both runs) and all frames after the start.
//   delta = sqrt(sum |x - x*|^2 / sum |x*|^2)                       (Neural Stress Fields, eq. 11)
//   displacement-relative = sqrt(sum |x - x*|^2 / sum |x* - X|^2)
// delta depends on where the origin is; the other one does not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compare/metrics/space.h"
#include "core/math/vec.h"

namespace graupel::compare {

class DisplacementError {
 public:
  explicit DisplacementError(std::vector<Vec3f> reference, const Space& space = {})
      : reference_(std::move(reference)), space_(space) {}
  /// A frame of the truth and of the run [m], and which particles count, [n]; empty: all.
  void add(const std::vector<Vec3f>& truth, const std::vector<Vec3d>& run, const std::vector<uint8_t>& counted = {});
  void add(const std::vector<Vec3f>& truth, const std::vector<Vec3f>& run, const std::vector<uint8_t>& counted = {});

  double delta() const;
  double displacement_relative() const;  ///< 0 where the truth does not move
  double root_mean_square() const;       ///< of |x - x*| [m]

 private:
  std::vector<Vec3f> reference_;
  Space space_;
  double error2_ = 0, position2_ = 0, displacement2_ = 0;
  std::size_t count_ = 0;
};

}  // namespace graupel::compare
