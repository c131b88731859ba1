// Which part of the particles' affine velocity the transfers carry from one substep to the next.
#pragma once

#include "core/fields.h"

namespace graupel {

enum class TransferScheme {
  apic,  ///< all of it (Jiang et al. 2015): conserves angular momentum, keeps affine velocity fields
  rpic,  ///< its rotation (the same paper): conserves angular momentum, damps stretching and shear
  pic    ///< nothing (Harlow 1964): damps all motion below the grid spacing
};
template <>
struct EnumWords<TransferScheme> {
  static constexpr std::pair<const char*, TransferScheme> words[] = {
      {"apic", TransferScheme::apic}, {"rpic", TransferScheme::rpic}, {"pic", TransferScheme::pic}};
};

struct TransferConfig {
  TransferScheme scheme = TransferScheme::apic;
  double damping = 0;  ///< [1/s]

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = TransferConfig;
    visit(&C::scheme,
          FieldInfo{
              .name = "scheme", .unit = "", .meaning = "apic: whole affine velocity; rpic: its rotation; pic: none"});
    visit(&C::damping, FieldInfo{.name = "damping",
                                 .unit = "1/s",
                                 .meaning = "Rate at which what is carried decays towards pic",
                                 .range = Range::not_negative(),
                                 .only_for = "apic rpic"});
  }
};

}  // namespace graupel
