// Numbers that a run has of every particle: its motion, and the fields.
#pragma once

#include "core/scene/particle_fields.h"

namespace graupel {

/// Position [m], velocity [m/s], and the fields of ParticleField with their units.
enum class ParticleQuantity { position, velocity, stress, affine, deformation_gradient, plastic };

inline ParticleQuantity quantity_of(ParticleField field) {
  switch (field) {
    case ParticleField::stress:
      return ParticleQuantity::stress;
    case ParticleField::affine:
      return ParticleQuantity::affine;
    case ParticleField::deformation_gradient:
      return ParticleQuantity::deformation_gradient;
    case ParticleField::plastic:
      break;
  }
  return ParticleQuantity::plastic;
}

/// Numbers a particle.
inline int components_of(ParticleQuantity quantity) {
  for (const ParticleField field : all_particle_fields)
    if (quantity_of(field) == quantity) return info_of(field).components;
  return 3;
}

}  // namespace graupel
