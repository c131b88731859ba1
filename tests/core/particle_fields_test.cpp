#include "core/scene/particle_fields.h"

#include <gtest/gtest.h>

#include "core/system/error.h"

namespace graupel {
namespace {

TEST(FieldSet, IsReadFromNamesInAnyOrder) {
  const FieldSet set = FieldSet::parse("plastic,stress");
  EXPECT_TRUE(set.contains(ParticleField::stress));
  EXPECT_TRUE(set.contains(ParticleField::plastic));
  EXPECT_FALSE(set.contains(ParticleField::affine));
  EXPECT_EQ(set.names(), "stress,plastic");
  EXPECT_EQ(set.components(), 7);
  EXPECT_EQ(FieldSet::parse(set.names()), set);
  EXPECT_EQ(FieldSet::parse(" stress, plastic\t").names(), "stress,plastic");
  EXPECT_TRUE(FieldSet::parse("").empty());
  EXPECT_EQ(FieldSet{}.names(), "");
}

TEST(FieldSet, UnknownNamesAreErrorsWithTheClosestOne) {
  const auto text_of = [](const char* names) -> std::string {
    try {
      FieldSet::parse(names);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(
      text_of("stress,afine"),
      "there is no field 'afine' (allowed: stress, affine, deformation_gradient, plastic). Did you mean 'affine'?");
  EXPECT_NE(text_of("temperature").find("Name one or several of these"), std::string::npos);
  EXPECT_NE(text_of("stress,,plastic").find("no field ''"), std::string::npos);
  EXPECT_NE(text_of("stress, ").find("no field ''"), std::string::npos);
}

}  // namespace
}  // namespace graupel
