#include "mpm/physics/contact.h"

#include <gtest/gtest.h>

namespace graupel::mpm {
namespace {

const Vec3d up = {0, 1, 0}, into = {3, -2, 4}, out = {3, 2, 4};

TEST(Contact, StickTakesAllVelocity) {
  EXPECT_EQ(apply_contact(Contact::stick, 0.0, up, into), (Vec3d{0, 0, 0}));
  EXPECT_EQ(apply_contact(Contact::stick, 0.0, up, out), (Vec3d{0, 0, 0}));
}

TEST(Contact, SlipTakesTheNormalVelocityBothWays) {
  EXPECT_EQ(apply_contact(Contact::slip, 0.0, up, into), (Vec3d{3, 0, 4}));
  EXPECT_EQ(apply_contact(Contact::slip, 0.0, up, out), (Vec3d{3, 0, 4}));
}

TEST(Contact, SeparateLetsTheMaterialLeave) {
  EXPECT_EQ(apply_contact(Contact::separate, 0.0, up, into), (Vec3d{3, 0, 4}));
  EXPECT_EQ(apply_contact(Contact::separate, 0.5, up, out), out);
}

TEST(Contact, FrictionTakesMuTimesTheNormalImpulseAndNeverReverses) {
  for (const Contact kind : {Contact::slip, Contact::separate}) {
    const Vec3d v = apply_contact(kind, 0.5, up, into);  // tangential speed 5, loss 0.5 * 2
    EXPECT_NEAR(norm(v), 4, 1e-14);
    EXPECT_NEAR(v[0] / v[2], 0.75, 1e-14);
    EXPECT_EQ(apply_contact(kind, 2.6, up, into), (Vec3d{0, 0, 0}));
  }
}

TEST(Contact, ActsAlongAnyNormalAndInTwoDimensions) {
  const Vec3d n = normalized(Vec3d{1, 2, -2});
  const Vec3d v = apply_contact(Contact::slip, 0.0, n, into);
  EXPECT_NEAR(dot(v, n), 0, 1e-14);
  EXPECT_NEAR(norm2(into - v), dot(into, n) * dot(into, n), 1e-13);
  const auto flat = apply_contact(Contact::separate, 1.0, Vec<double, 2>{0, 1}, Vec<double, 2>{3, -1});
  EXPECT_NEAR(flat[0], 2, 1e-15);
}

}  // namespace
}  // namespace graupel::mpm
