// The section of a source with the plane of a two-dimensional run, in a frame of the plane that follows the body's
// turns about z.
#pragma once

#include "mpm/scene/source_body.h"

namespace graupel::mpm {

using Vec2d = Vec<double, 2>;

class PlaneSection {
 public:
  /// `plane`: z of the plane in the world [m].
  PlaneSection(const Source& source, const SourceBody& body, double plane);

  /// Whether the body's box reaches the plane at all.
  bool is_met() const { return is_met_; }
  /// A box around the section [m].
  const Vec2d& low() const { return low_; }
  const Vec2d& high() const { return high_; }
  /// A point of the plane in the body's own frame.
  Vec3d local(const Vec2d& x) const { return x[0] * across_[0] + x[1] * across_[1] + height_ * normal_; }
  bool contains(const Vec2d& x) const { return body_.contains(local(x)); }
  /// Of the section, by counting the points of a lattice inside [m^2]: exact for boxes that stand upright.
  double area() const;

 private:
  const SourceBody& body_;
  Vec3d normal_, across_[2];  ///< of the plane, in the body's frame
  double height_;             ///< of the plane along the normal, from the body's origin [m]
  Vec2d low_, high_;
  bool is_met_;
};

}  // namespace graupel::mpm
