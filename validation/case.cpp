#include "validation/case.h"

#include <fmt/format.h>

#include <cmath>

#include "core/system/edit_distance.h"
#include "core/system/error.h"

namespace graupel::validation {

double Check::error() const {
  const double difference = measured - reference;
  return measure == Measure::relative ? difference / std::abs(reference) : difference;
}

bool Check::passed() const {
  switch (measure) {
    case Measure::at_most:
      return measured <= reference;
    case Measure::at_least:
      return measured >= reference;
    default:
      return std::abs(error()) <= tolerance;
  }
}

Check relative(const std::string& quantity, double measured, double reference, double tolerance) {
  return {quantity, measured, reference, tolerance, Measure::relative};
}
Check absolute(const std::string& quantity, double measured, double reference, double tolerance) {
  return {quantity, measured, reference, tolerance, Measure::absolute};
}
Check at_most(const std::string& quantity, double measured, double limit) {
  return {quantity, measured, limit, 0, Measure::at_most};
}
Check at_least(const std::string& quantity, double measured, double limit) {
  return {quantity, measured, limit, 0, Measure::at_least};
}

bool Outcome::passed() const {
  for (const Check& check : checks)
    if (!check.passed()) return false;
  return !checks.empty();
}

const Case& case_named(const std::string& name) {
  std::vector<std::string> names;
  for (const Case& c : cases()) {
    if (c.name == name) return c;
    names.push_back(c.name);
  }
  const std::string near = closest_of(name, names);
  throw ConfigError(fmt::format("unknown case '{}'.{} 'graupel bench validate --list' names all", name,
                                near.empty() ? "" : fmt::format(" Did you mean '{}'?", near)));
}

}  // namespace graupel::validation
