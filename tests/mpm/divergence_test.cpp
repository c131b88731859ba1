// What a run that blew up is told: a step that is stable, or the parameter that leaves none.
#include "mpm/solver/divergence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/system/error.h"
#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

MaterialConfig jelly(double youngs_modulus, double density) {
  MaterialConfig material;
  material.name = "block";
  material.model = MaterialModel::jelly;
  material.youngs_modulus = youngs_modulus;
  material.density = density;
  return material;
}

/// What is said of a jelly whose waves were at `sound_speed` before, with steps of 1e-3 s.
std::string told_of(const MaterialConfig& material, double sound_speed, double largest = 3e38) {
  Scene scene;
  scene.domain.dx = 0.01;
  scene.frame_time = 0.01;
  scene.time_step.policy = StepPolicy::fixed;
  DivergedParticle particle;
  particle.dt = 1e-3;
  particle.internal = 1;
  particle.before = {.speed = 0, .sound_speed = sound_speed};
  particle.wave = fastest_at_rest({jelly(1, 1000), material});
  particle.largest_number = largest;
  try {
    throw_diverged(scene, material, particle);
  } catch (const DivergedError& error) {
    return error.what();
  }
}

TEST(Divergence, TheStepIsStableForWavesAtRest) {
  const MaterialConfig stiff = jelly(9e7, 1000);  // c = sqrt(E (1 - nu) / ((1 + nu) (1 - 2 nu) rho)) = 316.2 m/s
  EXPECT_EQ(fastest_at_rest({jelly(1, 1000), stiff}).material, "block");
  // An eighth of the step, 1.25e-4 s, is 13 times too large.
  EXPECT_THAT(told_of(stiff, 316.2),
              AllOf(HasSubstr("Use a step of at most 9.487e-06 s"), HasSubstr("elastic waves at 316.2 m/s"),
                    HasSubstr("substeps_per_frame 1055")));
}

TEST(Divergence, AHalfBrokenStateIsNoBoundThatIsSure) {
  const std::string told = told_of(jelly(1e4, 1000), std::numeric_limits<double>::infinity());
  EXPECT_THAT(told, AllOf(HasSubstr("Try a step of 0.000125 s or less"), HasSubstr("substeps_per_frame 80"),
                          HasSubstr("at rest needs at most 0.0009")));
}

TEST(Divergence, AParameterThatLeavesNoStepIsNamed) {
  EXPECT_THAT(told_of(jelly(1e25, 1000), 1e11),
              AllOf(HasSubstr("No step helps"), HasSubstr("elastic waves of material 'block' 1.05"),
                    HasSubstr("Lower the stiffness"), Not(HasSubstr("substeps_per_frame"))));
  EXPECT_THAT(told_of(jelly(1e5, 1e300), 0),
              AllOf(HasSubstr("No step helps: density 1e+300 kg/m^3 of material 'block'"), HasSubstr("3e+38"),
                    Not(HasSubstr("substeps_per_frame"))));
  EXPECT_THAT(told_of(jelly(1e5, 1e300), 0, 1e308), Not(HasSubstr("density")));  // in double precision
  EXPECT_THAT(told_of(jelly(1e60, 1000), 0), HasSubstr("stiffness 1.111e+60 Pa of material 'block'"));
}

TEST(Divergence, RunsTellTheirOwn) {
  const auto told = [](Scene scene) -> std::string {
    scene.time_step.policy = StepPolicy::fixed;
    scene.time_step.substeps_per_frame = 1;
    try {
      const auto run = Simulation::create(scene, {});
      for (int f = 0; f < 20; ++f) run->advance_frame();
    } catch (const DivergedError& error) {
      return error.what();
    }
    return "";
  };
  Scene scene = scene_with("jelly", {0.5, 0.12, 0.5});
  const std::string name = scene.sources[0].material;
  scene.materials.at(name).youngs_modulus = 1e9;
  EXPECT_THAT(told(scene), HasSubstr("elastic waves at"));
  scene.materials.at(name).density = 1e300;
  EXPECT_THAT(told(scene), HasSubstr("No step helps: density 1e+300"));
}

}  // namespace
}  // namespace graupel::mpm
