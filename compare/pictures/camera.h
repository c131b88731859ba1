// Pinhole camera of the pictures.
#pragma once

#include "core/math/vec.h"
#include "core/scene/scene.h"

namespace graupel::compare {

struct Camera {
  Vec3d eye, right, up, forward;  ///< [m]; orthonormal axes
  double focal = 1;               ///< [pixels]
  int width = 0, height = 0;      ///< [pixels]

  struct Pixel {
    double x, y;   ///< [pixels] from the top left corner
    double depth;  ///< along `forward` [m]; not visible when <= 0
  };
  Pixel project(const Vec3d& point) const;
  /// Direction through a pixel, with forward component 1: point at depth d = eye + d ray.
  Vec3d ray(double x, double y) const;
};

/// Camera with the whole box in view, from the front, a little to the right and above. `up` is a unit axis.
Camera three_quarter_view(const Vec3d& low, const Vec3d& high, const Vec3d& up, int width, int height);

/// Unit axis against gravity, along the axis that gravity points along most.
Vec3d up_axis(const Scene& scene);

}  // namespace graupel::compare
