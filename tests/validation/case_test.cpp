// Every validation case in its quick form, and the rules by which a figure passes.
#include "validation/case.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"

namespace graupel::validation {

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

namespace {

class Validation : public testing::TestWithParam<Case> {};

TEST_P(Validation, AgreesWithItsReference) {
  set_num_threads(1);  // scenes of a few hundred particles
  const Outcome outcome = GetParam().run({});
  EXPECT_FALSE(outcome.checks.empty());
  for (const Check& check : outcome.checks)
    EXPECT_TRUE(check.passed()) << check.quantity << ": measured " << check.measured << ", reference "
                                << check.reference << ", error " << check.error() << ", tolerance " << check.tolerance;
  for (const Figure& figure : outcome.figures)
    for (const Curve& curve : figure.curves) {
      EXPECT_EQ(curve.x.size(), curve.y.size()) << figure.title << ", " << curve.label;
      EXPECT_FALSE(curve.x.empty()) << figure.title << ", " << curve.label;
    }
}

INSTANTIATE_TEST_SUITE_P(Cases, Validation, testing::ValuesIn(cases()),
                         [](const testing::TestParamInfo<Case>& one) { return one.param.name; });

TEST(Checks, PassInsideTheirToleranceOnly) {
  EXPECT_TRUE(relative("", 1.04, 1, 0.05).passed());
  EXPECT_FALSE(relative("", 1.06, 1, 0.05).passed());
  EXPECT_FALSE(relative("", -2.2, -2, 0.05).passed());
  EXPECT_TRUE(absolute("", -0.9, -1, 0.2).passed());
  EXPECT_FALSE(absolute("", -0.7, -1, 0.2).passed());
  EXPECT_TRUE(at_most("", 1, 1).passed());
  EXPECT_FALSE(at_most("", 1.1, 1).passed());
  EXPECT_TRUE(at_least("", 1, 1).passed());
  EXPECT_FALSE(at_least("", 0.9, 1).passed());
}

TEST(Checks, NumbersThatAreNoneNeverPass) {
  const double nan = std::nan("");
  for (const Check& check :
       {relative("", nan, 1, 9), absolute("", nan, 1, 9), at_most("", nan, 1), at_least("", nan, 1)})
    EXPECT_FALSE(check.passed());
}

TEST(Checks, AnOutcomeWithoutFiguresDoesNotPass) { EXPECT_FALSE(Outcome{}.passed()); }

TEST(Cases, HaveNamesOfTheirOwnAndUnknownOnesAreRefusedWithTheNearest) {
  std::set<std::string> names;
  for (const Case& c : cases()) EXPECT_TRUE(names.insert(c.name).second) << c.name;
  EXPECT_EQ(case_named("free_fall").name, "free_fall");
  try {
    case_named("fre_fall");
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("Did you mean 'free_fall'?"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace graupel::validation
