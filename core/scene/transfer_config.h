// The transfers between particles and grid: their spline, and which part of the particles' affine velocity they carry
// from one substep to the next.
#pragma once

#include "core/scene/fields.h"

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

/// The weight of a node for a particle.
enum class Spline {
  quadratic,  ///< 3 nodes an axis
  cubic       ///< 4 nodes an axis: smoother, less noise where particles cross cells
};
template <>
struct EnumWords<Spline> {
  static constexpr std::pair<const char*, Spline> words[] = {{"quadratic", Spline::quadratic},
                                                             {"cubic", Spline::cubic}};
};

struct TransferConfig {
  TransferScheme scheme = TransferScheme::apic;
  double damping = 0;  ///< [1/s]
  Spline spline = Spline::quadratic;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = TransferConfig;
    visit(&C::scheme, FieldInfo{"scheme", "", "apic: whole affine velocity; rpic: its rotation; pic: none"});
    visit(
        &C::damping,
        FieldInfo{"damping", "1/s", "Rate at which what is carried decays towards pic", Range::not_negative()}.only_in(
            "apic rpic"));
    visit(&C::spline, FieldInfo{"spline", "", "B-spline of the transfers; cubic: smoother, about twice the work"});
  }
};

}  // namespace graupel
