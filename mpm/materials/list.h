// The list of all materials: a law that stands here is known to every solver, portable, vectorised and on GPUs.
#pragma once

#include "mpm/materials/foam.h"
#include "mpm/materials/jelly.h"
#include "mpm/materials/neo_hookean.h"
#include "mpm/materials/sand.h"
#include "mpm/materials/snow.h"
#include "mpm/materials/toothpaste.h"
#include "mpm/materials/von_mises.h"
#include "mpm/materials/water.h"

namespace graupel::mpm {

/// Keeps its place and velocity; has mass and no stress.
struct StationaryLaw {
  static constexpr MaterialModel model = MaterialModel::stationary;
  static constexpr Measure measure = Measure::nothing;
  static constexpr double initial_internal = 0;
  static constexpr bool keeps_volume_positive = false;
  static constexpr bool sound_speed_reads_F = false;

  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>&, const Mat<T, D>&, T) {
    return T(0);
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>&, S) {
    return S(m.elastic_speed);
  }
};

template <typename... Laws>
struct LawList {};

/// Laws that are compiled into the solvers' loops, and laws that these loops call as functions.
using FrequentLaws = LawList<WaterLaw, JellyLaw, SnowLaw, SandLaw>;
using OtherLaws = LawList<NeoHookeanLaw, MetalLaw, CakeLaw, ToothpasteLaw, FoamLaw, StationaryLaw>;

/// body(law) of the law with this model; false where the list has none.
template <typename Body, typename... Laws>
GRAUPEL_HD inline bool with_law(LawList<Laws...>, MaterialModel model, Body&& body) {
  return ((model == Laws::model ? (body(Laws{}), true) : false) || ...);
}
/// The same of all laws.
template <typename Body>
GRAUPEL_HD inline void with_law(MaterialModel model, Body&& body) {
  if (!with_law(FrequentLaws{}, model, body)) with_law(OtherLaws{}, model, body);
}

/// Whether the law of this model is a function of `measure`. Only laws of that measure are compared.
template <Measure measure, typename... Laws>
GRAUPEL_HD constexpr bool has_measure(LawList<Laws...>, MaterialModel model) {
  return ((Laws::measure == measure && model == Laws::model) || ...);
}
template <Measure measure>
GRAUPEL_HD constexpr bool has_measure(MaterialModel model) {
  return has_measure<measure>(FrequentLaws{}, model) || has_measure<measure>(OtherLaws{}, model);
}
/// A fluid: its stress depends on J and, by viscosity, on the affine velocity.
GRAUPEL_HD constexpr bool is_fluid(MaterialModel model) { return has_measure<Measure::volume_ratio>(model); }

/// body(law) of the fluid with this model.
template <typename Body>
GRAUPEL_HD inline void with_fluid(MaterialModel model, Body&& body) {
  with_law(model, [&](auto law) {
    if constexpr (decltype(law)::measure == Measure::volume_ratio) body(law);
  });
}

}  // namespace graupel::mpm
