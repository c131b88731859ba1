// Obstacles made of several bodies: paddles, sliding boxes and trays with their scripts, and containers.
#pragma once

#include "mpm/scene/categories/scene_draft.h"

namespace graupel::mpm {

/// Blades that turn about a common axis for a part of the run. These three return a body that encloses the motion.
Body add_paddle(SceneDraft& draft);
/// A box on the floor that slides to and fro.
Body add_sliding_box(SceneDraft& draft);
/// A tray with rims above the floor that tilts to both sides.
Body add_tray(SceneDraft& draft);

/// The opening of a container: a box in the world above whose lower face it is open [m].
struct Opening {
  Vec3d center;  ///< of the opening
  double width, depth;
  double volume;  ///< of the container [m^3]
};
/// A box without a lid on the floor, or a level set of the recipe.
Opening add_container(SceneDraft& draft);

}  // namespace graupel::mpm
