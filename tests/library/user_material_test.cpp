// Laws of the caller's own in the solver: the built-in ones written anew move as those, laws with a state keep it, and
// bad laws are refused.
#include <graupel/io.h>
#include <graupel/mpm.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "graupel/core/math/polar.h"
#include "graupel/core/math/svd.h"
#include "tests/library/test_scenes.h"

namespace graupel {
namespace {

using test::spinning_block;

/// Stable neo-Hookean elasticity (Smith, de Goes and Kim 2018, eq. 13) with the constants of section 3.4.
class NeoHookean : public UserMaterial {
 public:
  explicit NeoHookean(const MaterialConfig& m, double stiffness = 1) : density_(m.density) {
    const double E = stiffness * m.youngs_modulus, nu = m.poissons_ratio;
    const double lambda = E * nu / ((1 + nu) * (1 - 2 * nu)), mu = E / (2 * (1 + nu));
    mu_ = 4 * mu / 3;
    lambda_ = lambda + 5 * mu / 6;
    speed_ = std::sqrt((lambda + 2 * mu) / density_);
  }
  Mat3d stress(const MaterialStep&, MaterialState& state) const override {
    const double J = determinant(state.F), I = double_dot(state.F, state.F), a = 1 + 0.75 * mu_ / lambda_;
    return mu_ * (1 - 1 / (I + 1)) * (state.F * transpose(state.F)) + lambda_ * J * (J - a) * Mat3d::identity();
  }
  double sound_speed(const MaterialState&) const override { return speed_; }
  double energy(const MaterialState& state) const override {
    const double J = determinant(state.F), I = double_dot(state.F, state.F), a = 1 + 0.75 * mu_ / lambda_;
    return mu_ / 2 * (I - 3 - std::log((I + 1) / 4)) + lambda_ / 2 * ((J - a) * (J - a) - (1 - a) * (1 - a));
  }

 protected:
  double density_, mu_, lambda_, speed_;
};

/// Fixed corotated elasticity (Stomakhin et al. 2012) by singular values.
class FixedCorotated : public UserMaterial {
 public:
  explicit FixedCorotated(const MaterialConfig& m)
      : density_(m.density),
        lambda_(m.youngs_modulus * m.poissons_ratio / ((1 + m.poissons_ratio) * (1 - 2 * m.poissons_ratio))),
        mu_(m.youngs_modulus / (2 * (1 + m.poissons_ratio))) {}
  Mat3d stress(const MaterialStep&, MaterialState& state) const override {
    const Svd<double, 3> d = svd(state.F);
    const Mat3d R = d.U * transpose(d.V);
    const double J = determinant(state.F);
    return 2 * mu_ * ((state.F - R) * transpose(state.F)) + lambda_ * J * (J - 1) * Mat3d::identity();
  }
  double sound_speed(const MaterialState&) const override { return std::sqrt((lambda_ + 2 * mu_) / density_); }

 private:
  double density_, lambda_, mu_;
};

template <typename Law, typename... More>
SimulationSettings with_law(const Scene& scene, bool f64, More... more) {
  return {.f64 = f64, .materials = {{"matter", std::make_shared<Law>(scene.materials.at("matter"), more...)}}};
}

/// Largest distance of particles after the scene's frames [m].
double difference(Simulation& one, Simulation& other) {
  for (int64_t frame = 0; frame < one.scene().frames; ++frame) one.advance_frame(), other.advance_frame();
  double largest = 0;
  for (std::size_t i = 0; i < one.particle_count(); ++i)
    largest = std::max<double>(largest, norm(one.position()[i] - other.position()[i]));
  return largest;
}

TEST(UserMaterial, TheBuiltInNeoHookeanWrittenAnewIsTheSameToRoundOff) {
  const Scene scene = spinning_block("neo_hookean");
  Simulation built_in(scene, {.f64 = true}), own(scene, with_law<NeoHookean>(scene, true));
  EXPECT_LT(difference(built_in, own), 1e-7);  // positions are given in f32
  const Balance a = built_in.balance(), b = own.balance();
  EXPECT_NEAR(a.kinetic, b.kinetic, 1e-11 * a.kinetic);
  EXPECT_GT(a.elastic, 1e-6);
  EXPECT_NEAR(a.elastic, b.elastic, 1e-10 * a.elastic);
}

TEST(UserMaterial, TheLawDecidesTheMotion) {
  const Scene scene = spinning_block("neo_hookean");
  Simulation built_in(scene, {.f64 = true}), stiffer(scene, with_law<NeoHookean>(scene, true, 1.5));
  EXPECT_GT(difference(built_in, stiffer), 1e-5);
}

TEST(UserMaterial, JellyWrittenAnewIsTheSameInBothPrecisions) {
  const Scene scene = spinning_block("jelly");
  for (const bool f64 : {false, true}) {
    Simulation built_in(scene, {.f64 = f64}), own(scene, with_law<FixedCorotated>(scene, f64));
    EXPECT_LT(difference(built_in, own), f64 ? 1e-7 : 1e-5);
  }
}

TEST(UserMaterial, PlaneScenesAndOtherTransfersRunThemToo) {
  for (const char* change : {"domain.dimensions=2", "transfer.spline=cubic", "transfer.damping=0.1"}) {
    const Scene scene = spinning_block("jelly", change);
    Simulation built_in(scene, {.f64 = true}), own(scene, with_law<FixedCorotated>(scene, true));
    EXPECT_LT(difference(built_in, own), 1e-7) << change;
  }
}

TEST(UserMaterial, OtherMaterialsOfTheSceneKeepTheirLaws) {
  Scene scene = spinning_block("jelly");
  for (const char* preset : {"sand", "water"}) {
    scene.materials[preset] = *material_preset(preset);
    Source more = scene.sources[0];
    more.material = preset;
    more.position[1] += preset[0] == 's' ? 0.1 : -0.1;
    scene.sources.push_back(more);
  }
  scene = checked_scene(scene);
  Simulation built_in(scene, {.f64 = true}), own(scene, with_law<FixedCorotated>(scene, true));
  EXPECT_LT(difference(built_in, own), 1e-6);
  EXPECT_TRUE(std::equal(own.particle_type().begin(), own.particle_type().end(), built_in.particle_type().begin()));
}

TEST(UserMaterial, AdaptiveStepsFollowItsSoundSpeed) {
  Scene scene = spinning_block("jelly");
  scene.time_step = {};
  Simulation soft(scene, with_law<NeoHookean>(scene, false)), stiff(scene, with_law<NeoHookean>(scene, false, 4.0));
  soft.advance_frame();
  stiff.advance_frame();
  EXPECT_GT(stiff.substeps(), 1.6 * static_cast<double>(soft.substeps()));
  EXPECT_LT(stiff.substeps(), 2.1 * static_cast<double>(soft.substeps()));
}

/// Elastic until the particle has been sheared for long enough: counts its steps in the internal variable, and flows.
class Counting : public FixedCorotated {
 public:
  using FixedCorotated::FixedCorotated;
  Mat3d stress(const MaterialStep& step, MaterialState& state) const override {
    state.internal += step.dt;
    if (state.internal > 3 + 0.02) state.F = Mat3d::identity();
    return FixedCorotated::stress(step, state);
  }
  double initial_internal() const override { return 3; }
};

TEST(UserMaterial, StateIsKeptAndMayBeChanged) {
  const Scene scene = spinning_block("jelly");
  Simulation run(scene, with_law<Counting>(scene, false));
  EXPECT_EQ(run.field(ParticleField::plastic)[0], 3.0f);
  run.advance_frame();
  EXPECT_NEAR(run.field(ParticleField::plastic)[11], 3 + 1.0 / 60, 1e-5);
  EXPECT_NE(run.field(ParticleField::deformation_gradient)[9 * 11], 1.0f);
  run.advance_frame();
  EXPECT_EQ(run.field(ParticleField::deformation_gradient)[9 * 11], 1.0f);
}

TEST(UserMaterial, ResultsDoNotDependOnThreads) {
  const Scene scene = spinning_block("jelly");
  const int threads = num_threads();
  set_num_threads(1);
  Simulation one(scene, with_law<FixedCorotated>(scene, false));
  one.advance_frame();
  set_num_threads(3);
  Simulation three(scene, with_law<FixedCorotated>(scene, false));
  three.advance_frame();
  set_num_threads(threads);
  EXPECT_TRUE(std::equal(one.position().begin(), one.position().end(), three.position().begin()));
}

TEST(UserMaterial, SavedStatesBelongToRunsWithLawsOfTheSameMaterials) {
  const Scene scene = spinning_block("jelly");
  Simulation own(scene, with_law<FixedCorotated>(scene, false)), plain(scene);
  own.advance_frame();
  EXPECT_THROW(plain.load_state(own.save_state()), InputError);
  Simulation again(scene, with_law<FixedCorotated>(scene, false));
  again.load_state(own.save_state());
  own.advance_frame();
  again.advance_frame();
  EXPECT_TRUE(std::equal(own.position().begin(), own.position().end(), again.position().begin()));
}

class Throwing : public FixedCorotated {
 public:
  using FixedCorotated::FixedCorotated;
  Mat3d stress(const MaterialStep&, MaterialState&) const override { throw std::domain_error("no such state"); }
};
class NotANumber : public FixedCorotated {
 public:
  using FixedCorotated::FixedCorotated;
  Mat3d stress(const MaterialStep&, MaterialState&) const override {
    return std::numeric_limits<double>::quiet_NaN() * Mat3d::identity();
  }
};
class WithoutSound : public FixedCorotated {
 public:
  using FixedCorotated::FixedCorotated;
  double sound_speed(const MaterialState&) const override { return 0; }
};

TEST(UserMaterial, BadLawsAreToldByName) {
  const Scene scene = spinning_block("jelly");
  Simulation throwing(scene, with_law<Throwing>(scene, false));
  EXPECT_THROW(throwing.advance_frame(), std::domain_error);
  Simulation without_number(scene, with_law<NotANumber>(scene, false));
  try {
    without_number.advance_frame();
    FAIL();
  } catch (const DivergedError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("(jelly, material 'matter')"), std::string::npos) << text;
    EXPECT_NE(text.find("its state is not a number"), std::string::npos) << text;
  }
  const auto refusal = [&](const SimulationSettings& settings) -> std::string {
    try {
      Simulation run(scene, settings);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refusal(with_law<WithoutSound>(scene, false)).find("0 m/s at rest"), std::string::npos);
  EXPECT_NE(refusal({.materials = {{"matter", nullptr}}}).find("null pointer"), std::string::npos);
  const auto law = std::make_shared<FixedCorotated>(scene.materials.at("matter"));
  EXPECT_NE(refusal({.materials = {{"mater", law}}}).find("'mater'"), std::string::npos);
}

}  // namespace
}  // namespace graupel
