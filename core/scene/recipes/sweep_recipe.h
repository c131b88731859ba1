// A sweep: one scene run for several values of its parameters, the snapshots that reduced-order models are trained on
// (Neural Stress Fields, Zong et al. 2023).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/fields.h"
#include "core/scene/interval.h"
#include "core/system/any_value.h"

namespace graupel {

/// Which runs are for training: those in neither list, or none.
enum class TrainingRuns { rest, none };
template <>
struct EnumWords<TrainingRuns> {
  static constexpr std::pair<const char*, TrainingRuns> words[] = {{"rest", TrainingRuns::rest},
                                                                   {"none", TrainingRuns::none}};
};

/// Runs that are drawn in the box of the parameters' ranges (io/scene/sweep_draw.h).
struct SweepDraw {
  int64_t train = 0, valid = 0, test = 0;
  uint64_t seed = 1;

  bool is_set() const { return train + valid + test > 0; }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using D = SweepDraw;
    visit(&D::train, FieldInfo{"train", "",
                               "Runs for training: the corners of the box, then Halton's points; none, or at least the "
                               "corners",
                               Range::between(0, 4096)});
    visit(&D::valid, FieldInfo{"valid", "", "Runs for validation, at random in the box", Range::between(0, 4096)});
    visit(&D::test, FieldInfo{"test", "", "Runs for testing, at random in the box", Range::between(0, 4096)});
    visit(&D::seed, FieldInfo{"seed", "", "Seed of the runs at random"});
  }
};

/// A further scene key that follows a parameter.
struct SweepFollower {
  std::string key;
  std::vector<AnyValue> values;  ///< [runs]
  std::vector<AnyValue> range;   ///< its values at the ends of the parameter's range

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using F = SweepFollower;
    visit(&F::key, FieldInfo{"key", "", "Scene key, as a dotted path"}.mandatory());
    visit(&F::values, FieldInfo{"values", "", "Its value in each run: numbers, words, vectors, ..."});
    visit(&F::range, FieldInfo{"range", "",
                               "With `draw`: its values (numbers or vectors) at the ends of the parameter's range, "
                               "linear between them"});
  }
};

/// What differs between the runs.
struct SweepParameter {
  std::string name;
  std::string unit;
  std::string key;
  std::vector<double> values;  ///< [runs]
  Interval range;              ///< of runs that are drawn
  std::vector<SweepFollower> also;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using P = SweepParameter;
    visit(&P::name, FieldInfo{"name", "", "Name under which the values are stored with the trajectories"}.mandatory());
    visit(&P::unit, FieldInfo{"unit", "", "Unit of the values, as text"});
    visit(&P::key, FieldInfo{"key", "", "Scene key, as a dotted path: materials.sand.friction_angle"}.mandatory());
    visit(&P::values, FieldInfo{"values", "", "Its value in each run: run i takes item i of every list"});
    visit(&P::range, FieldInfo{"range", "", "With `draw`: least and greatest value"});
    visit(&P::also, FieldInfo{"also", "", "Further scene keys that follow the same parameter"});
  }
};

struct SweepRecipe {
  std::string name;
  std::string description;
  std::string scene;
  std::map<std::string, AnyValue> set;  ///< by scene key
  std::vector<SweepParameter> parameters;
  SweepDraw draw;
  std::vector<int64_t> test, valid;  ///< numbers of runs, in ascending order
  TrainingRuns training = TrainingRuns::rest;
  std::string fields_stored;
  int64_t deflate = 1;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using R = SweepRecipe;
    visit(&R::name, FieldInfo{"name", "", "Short name; default the scene's"});
    visit(&R::description, FieldInfo{"description", "", "What the sweep shows"});
    visit(&R::scene,
          FieldInfo{"scene", "", "Scene file, relative to the recipe's folder; this key makes a recipe a sweep"}
              .mandatory());
    visit(&R::set, FieldInfo{"set", "",
                             "Scene keys that all runs change, by dotted path (\"domain.dx\": 0.02); an object "
                             "replaces the scene's as a whole"});
    visit(
        &R::parameters,
        FieldInfo{"parameters", "", "What differs between the runs; all lists of values have one length"}.mandatory());
    visit(&R::draw, FieldInfo{"draw", "", "Draws the runs in the box of the parameters' ranges, instead of lists"});
    visit(&R::test, FieldInfo{"test", "", "Runs for testing, counted from 0", Range::not_negative()});
    visit(&R::valid, FieldInfo{"valid", "", "Runs for validation", Range::not_negative()});
    visit(&R::training,
          FieldInfo{"training", "", "Runs for training: rest, all in neither list; none, a set for testing"});
    visit(&R::fields_stored,
          FieldInfo{"fields", "", "Fields stored in every frame: stress,affine,deformation_gradient,plastic"});
    visit(&R::deflate, FieldInfo{"deflate", "", "Compression of the data, from none to the smallest and slowest",
                                 Range::between(0, 9)});
  }
};

}  // namespace graupel
