// What a particle carries beside position and velocity: stress, affine velocity, deformation, plastic state. Reduced
// models are trained on these fields; trajectories store those that are asked for.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

namespace graupel {

enum class ParticleField : uint8_t {
  stress,                ///< Kirchhoff stress tau = P F^T [Pa]: xx, xy, xz, yy, yz, zz
  affine,                ///< affine velocity C [1/s], row by row
  deformation_gradient,  ///< elastic part of F, row by row; identity for water
  plastic                ///< J, J_p, v_c or the equivalent plastic strain, by model (mpm/materials/material.h)
};

inline constexpr std::array all_particle_fields = {ParticleField::stress, ParticleField::affine,
                                                   ParticleField::deformation_gradient, ParticleField::plastic};

/// How a field is called and stored.
struct ParticleFieldInfo {
  const char* name;         ///< on the command line, and of the dataset
  int components;           ///< numbers a particle
  const char* units;        ///< "" for none
  const char* description;  ///< with the order of the components
};
const ParticleFieldInfo& info_of(ParticleField field);

/// A selection of fields.
class FieldSet {
 public:
  FieldSet() = default;
  FieldSet(std::initializer_list<ParticleField> fields) {
    for (const ParticleField field : fields) add(field);
  }
  /// From "stress,plastic"; "" selects none. Throws ConfigError for an unknown name, with the closest one.
  static FieldSet parse(const std::string& names);

  void add(ParticleField field) { bits_ = static_cast<uint8_t>(bits_ | bit(field)); }
  bool contains(ParticleField field) const { return (bits_ & bit(field)) != 0; }
  bool empty() const { return bits_ == 0; }
  /// "stress,plastic", in the order of the enum.
  std::string names() const;
  /// Numbers that one particle has in all selected fields.
  int components() const;
  bool operator==(const FieldSet&) const = default;

 private:
  static uint8_t bit(ParticleField field) { return static_cast<uint8_t>(1u << static_cast<unsigned>(field)); }
  uint8_t bits_ = 0;
};

/// The values of some fields for all particles, in the order of a frame: shape [n, components] each, empty where a
/// field was not asked for.
struct ParticleFields {
  std::array<std::vector<float>, all_particle_fields.size()> values;

  std::vector<float>& operator[](ParticleField field) { return values[static_cast<std::size_t>(field)]; }
  const std::vector<float>& operator[](ParticleField field) const { return values[static_cast<std::size_t>(field)]; }
  bool operator==(const ParticleFields&) const = default;
};

}  // namespace graupel
