// Constants with which a coarse grid moves as the fine one does with the scene's own: numerical coarsening (Chen et al.
// 2017, "Dynamics-aware numerical coarsening for fabrication design"). A trained exponent each:
//   p' = p exp(offset + slope ln(p / reference)),   friction angles by their tangent.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace graupel::hybrid {

/// How one constant of one material law is replaced.
struct ConstantRule {
  MaterialModel model;
  const char* constant;            ///< key of a material in a scene file
  double MaterialConfig::*member;  ///< the constant
  double reference;                ///< p, where the slope has no effect
  bool has_slope;                  ///< whether the offset may depend on the constant
  double low, high;                ///< p' is kept within, unless p is outside [unit of the constant]
};

/// The rules, in the order of EffectiveConstants' numbers.
const std::vector<ConstantRule>& constant_rules();

/// Trained offsets and slopes; all zero: the scene's own constants.
struct EffectiveConstants {
  std::vector<double> offset, slope;  ///< [constant_rules()]
  double wall_friction = 0;           ///< mu' = mu exp(wall_friction), of walls; obstacles keep theirs

  EffectiveConstants();
  /// Materials without a rule are left as they are.
  MaterialConfig material(const MaterialConfig& of) const;
  /// The scene with these constants in place of its own.
  Scene scene(const Scene& of) const;
};

}  // namespace graupel::hybrid
