// A validation case: a run whose answer theory or an experiment knows, and how far the solver is from it.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace graupel::validation {

enum class Form {
  quick,  ///< as coarse as still means something; what the tests run
  full    ///< the resolution of the reference, minutes at most
};

/// How a measured value is held against its reference.
enum class Measure {
  relative,  ///< |measured - reference| <= tolerance |reference|
  absolute,  ///< |measured - reference| <= tolerance
  at_most,   ///< measured <= reference
  at_least   ///< measured >= reference
};

/// One figure beside its reference.
struct Check {
  std::string quantity;  ///< with its unit
  double measured = 0, reference = 0;
  double tolerance = 0;  ///< share (relative) or in the quantity's unit (absolute)
  Measure measure = Measure::relative;

  /// As a share of the reference (relative), else in the quantity's unit.
  double error() const;
  bool passed() const;
};

Check relative(const std::string& quantity, double measured, double reference, double tolerance);
Check absolute(const std::string& quantity, double measured, double reference, double tolerance);
Check at_most(const std::string& quantity, double measured, double limit);
Check at_least(const std::string& quantity, double measured, double limit);

enum class CurveRole { measured, reference };

struct Curve {
  std::string label;
  std::vector<double> x, y;  ///< same length
  CurveRole role = CurveRole::measured;
};

enum class Scale { linear, logarithmic };

struct Figure {
  std::string title, x_label, y_label;
  std::vector<Curve> curves;
  Scale y_scale = Scale::linear;
};

struct Outcome {
  std::vector<Check> checks;
  std::vector<Figure> figures;

  void add(const Check& check) { checks.push_back(check); }
  bool passed() const;
};

struct RunOptions {
  Form form = Form::quick;
  std::function<void()> between_frames = [] {};  ///< may throw, to end a run early

  /// The value for the form.
  template <typename T>
  T pick(T quick, T full) const {
    return form == Form::quick ? quick : full;
  }
};

struct Case {
  std::string name;       ///< one word, for --case
  std::string title;      ///< what is run
  std::string reference;  ///< equation or paper that the answer comes from
  Outcome (*run)(const RunOptions&);
};

/// All cases, cheapest laws first.
const std::vector<Case>& cases();
/// Throws ConfigError, with the nearest name, for an unknown one.
const Case& case_named(const std::string& name);

}  // namespace graupel::validation
