// Which material the particle types of other programs' data sets are.
//   gns            3 obstacle (kinematic), 4 jelly, 5 water, 6 sand, 7 toothpaste (goop), 8 snow
//   lagrangebench  0 water (fluid), 1 obstacle (solid wall), 2 stationary (moving wall), 4 jelly, 6 sand, 7 toothpaste,
//                  8 snow
// GNS fixes 3, 5, 6 and 7, LagrangeBench 0 to 3; the others are free rows of their tables of nine, where we keep our
// own numbers. Rigid bodies (0 of GNS, 3 of LagrangeBench) are no material of ours: users must say what they are.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/data_set_format.h"

namespace graupel::io {

class ParticleTypeTable {
 public:
  /// `changes` are "5=water,6=sand": their number, our material or "obstacle". Throws ConfigError for other texts.
  ParticleTypeTable(DataSetFormat format, const std::string& changes);

  /// Our types (core/material_config.h). Throws InputError that names every type without a material; `where` is the
  /// trajectory.
  std::vector<int32_t> to_ours(const std::vector<int64_t>& theirs, const std::string& where) const;
  /// The other way. Throws InputError that names every material without a number.
  std::vector<int64_t> to_theirs(const std::vector<int32_t>& ours, const std::string& where) const;
  /// "water" for their number.
  std::string name_of(int64_t theirs) const;

 private:
  void change(const std::string& text);

  DataSetFormat format_;
  std::map<int64_t, int32_t> ours_;
  std::map<int32_t, int64_t> theirs_;
};

}  // namespace graupel::io
