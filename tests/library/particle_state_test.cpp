// Runs from particles that are given one by one.
#include <graupel/mpm.h>
#include <graupel/particle_state.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tests/library/test_scenes.h"

namespace graupel {
namespace {

using test::spinning_block;

/// The state of a run with all its fields.
ParticleState state_of(const Simulation& run, const std::string& material) {
  ParticleState state;
  const auto matrices = [&](ParticleField field) {
    std::vector<Mat3d> all(run.particle_count());
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t k = 0; k < 9; ++k)
        all[i](static_cast<int>(k / 3), static_cast<int>(k % 3)) = run.field(field)[9 * i + k];
    return all;
  };
  for (const Vec3f& x : run.position()) state.position.push_back(x.cast<double>());
  for (const Vec3f& v : run.velocity()) state.velocity.push_back(v.cast<double>());
  state.deformation_gradient = matrices(ParticleField::deformation_gradient);
  state.affine_velocity = matrices(ParticleField::affine);
  for (const float p : run.field(ParticleField::plastic)) state.plastic.push_back(p);
  state.material = {material};
  return state;
}

double largest_distance(const Simulation& one, const Simulation& other) {
  double largest = 0;
  for (std::size_t i = 0; i < one.particle_count(); ++i)
    largest = std::max<double>(largest, norm(one.position()[i] - other.position()[i]));
  return largest;
}

TEST(ParticleState, ARunGoesOnFromTheArraysOfAFrame) {
  for (const std::string preset : {"jelly", "water", "sand", "snow", "toothpaste", "metal"}) {
    Scene scene = spinning_block(preset, "time_step={\"policy\": \"adaptive\"}");
    scene.sources[0].position[1] = 0.1;  // on the floor
    Simulation run(scene, {.f64 = true});
    for (int frame = 0; frame < 3; ++frame) run.advance_frame();
    const ParticleState state = state_of(run, "matter");
    ParticleState without_deformation = state;
    without_deformation.deformation_gradient.clear();
    without_deformation.plastic.clear();
    Simulation from(with_particles(scene, state), {.f64 = true});
    Simulation undeformed(with_particles(scene, without_deformation), {.f64 = true});
    const std::span<const float> stress = run.field(ParticleField::stress), same = from.field(ParticleField::stress);
    double largest = 0, difference = 0;
    for (std::size_t i = 0; i < stress.size(); ++i) {
      largest = std::max<double>(largest, std::abs(stress[i]));
      difference = std::max<double>(difference, std::abs(stress[i] - same[i]));
    }
    EXPECT_GT(largest, 0) << preset;
    EXPECT_LT(difference, 2e-3 * largest) << preset;
    for (int frame = 0; frame < 2; ++frame) run.advance_frame(), from.advance_frame(), undeformed.advance_frame();
    EXPECT_LT(largest_distance(run, from), 2e-6) << preset;
    EXPECT_GT(largest_distance(run, undeformed), 5 * largest_distance(run, from)) << preset;
  }
}

TEST(ParticleState, AStretchedBlockHasItsEnergyAndStress) {
  Scene scene = spinning_block("jelly");
  scene.materials["matter"].youngs_modulus = 1e5;
  scene.materials["matter"].poissons_ratio = 0;  // lambda 0, mu E / 2
  ParticleState state;
  for (int i = 0; i < 1000; ++i)
    state.position.push_back({0.2 + 0.01 * (i % 10), 0.2 + 0.01 * (i / 10 % 10), 0.2 + 0.01 * (i / 100)});
  state.deformation_gradient.assign(1000, Mat3d::diagonal({1.1, 1, 1}));
  state.volume.assign(1000, 1e-6);
  state.material = {"matter"};
  EXPECT_NEAR(with_particles(scene, state).sources[0].particles_per_cell, scene.domain.cell_volume() / 1e-6, 1e-9);
  const Simulation run(with_particles(scene, state), {.f64 = true});
  EXPECT_NEAR(run.balance().elastic, 1e-3 * 5e4 * 0.01, 1e-6);  // V mu (s - 1)^2
  EXPECT_NEAR(run.field(ParticleField::stress)[0], 2 * 5e4 * 0.1 * 1.1, 1);
  EXPECT_NEAR(run.field(ParticleField::stress)[3], 0, 1);
  EXPECT_NEAR(run.balance().mass, 1e-3 * scene.materials["matter"].density, 1e-9);
}

TEST(ParticleState, AnOwnLawGivesTheStressOfTheStart) {
  struct Spring : UserMaterial {
    Mat3d stress(const MaterialStep& step, MaterialState& state) const override {
      return (step.dt == 0 ? 1000.0 : -1.0) * (state.F - Mat3d::identity()) + state.internal * Mat3d::identity();
    }
    double sound_speed(const MaterialState&) const override { return 10; }
    double initial_internal() const override { return 7; }
  };
  const Scene scene = spinning_block("jelly");
  ParticleState state;
  state.position = {{0.2, 0.2, 0.2}, {0.3, 0.2, 0.2}};
  state.deformation_gradient = {Mat3d::identity(), Mat3d::diagonal({1.5, 1, 1})};
  state.material = {"matter"};
  const SimulationSettings settings = {.materials = {{"matter", std::make_shared<Spring>()}}};
  const Simulation run(with_particles(scene, state), settings);
  EXPECT_EQ(run.field(ParticleField::stress)[0], 7);
  EXPECT_EQ(run.field(ParticleField::stress)[6], 507);
  state.plastic = {0, 20};
  const Simulation other(with_particles(scene, state), settings);
  EXPECT_EQ(other.field(ParticleField::stress)[0], 0);
  EXPECT_EQ(other.field(ParticleField::stress)[6], 520);
}

TEST(ParticleState, ParticlesKeepTheirOrderAndMaterials) {
  Scene scene = spinning_block("jelly");
  scene.materials["wet"] = *material_preset("water");
  ParticleState state;
  state.position = {{0.2, 0.2, 0.2}, {0.3, 0.2, 0.2}, {0.25, 0.3, 0.2}};
  state.velocity = {{1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  state.material = {"wet", "matter", "wet"};
  const Simulation run(with_particles(scene, state));
  ASSERT_EQ(run.particle_count(), 3u);
  EXPECT_EQ(run.velocity()[1][1], 2);
  EXPECT_EQ(run.particle_type()[0], particle_type_of(MaterialModel::water));
  EXPECT_EQ(run.particle_type()[1], particle_type_of(MaterialModel::jelly));
}

TEST(ParticleState, ASavedStateIsOfItsArrays) {
  const Scene scene = spinning_block("jelly");
  ParticleState state;
  state.position = {{0.2, 0.2, 0.2}, {0.3, 0.2, 0.2}};
  state.material = {"matter"};
  const auto saved = Simulation(with_particles(scene, state)).save_state();
  Simulation same(with_particles(scene, state));
  same.load_state(saved);
  state.velocity.assign(2, {0, 1, 0});
  Simulation other(with_particles(scene, state));
  EXPECT_THROW(other.load_state(saved), InputError);
}

TEST(ParticleState, ErrorsNameParticleValueAndWhatIsAllowed) {
  const Scene scene = spinning_block("jelly");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Bad {
    std::function<void(ParticleState&)> spoil;
    const char* message;
  };
  const Bad cases[] = {
      {[&](ParticleState& s) { s.position[1][2] = nan; }, "position[1] = (0.3, 0.2, nan)"},
      {[](ParticleState& s) { s.position[1][0] = 3; }, "allowed: (0.06, 0.06, 0.06) to (0.42, 0.42, 0.42)"},
      {[](ParticleState& s) { s.velocity.resize(1); },
       "velocity has another length than the positions (1, allowed: 2)"},
      {[&](ParticleState& s) { s.velocity[0][0] = nan; }, "velocity[0] = (nan, 0, 0)"},
      {[](ParticleState& s) { s.deformation_gradient[1](0, 0) = -1; }, "deformation_gradient[1] = [[-1, 0, 0]"},
      {[](ParticleState& s) { s.deformation_gradient.pop_back(); }, "deformation_gradient has another length"},
      {[](ParticleState& s) {
         s.volume = {1e-6, 0};
       },
       "volume[1] = 0"},
      {[](ParticleState& s) {
         s.material = {"matter", "jely"};
       },
       "material[1] = 'jely' is not in the scene (allowed: matter)"},
      {[](ParticleState& s) {
         s.material = {"matter", "matter", "matter"};
       },
       "allowed: 1 or 2"},
      {[](ParticleState& s) { s.position.clear(); }, "0 particles"},
  };
  for (const Bad& bad : cases) {
    ParticleState state;
    state.position = {{0.2, 0.2, 0.2}, {0.3, 0.2, 0.2}};
    state.velocity.assign(2, Vec3d::zero());
    state.deformation_gradient.assign(2, Mat3d::identity());
    state.material = {"matter"};
    bad.spoil(state);
    try {
      with_particles(scene, state);
      ADD_FAILURE() << "not refused: " << bad.message;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(bad.message), std::string::npos) << error.what();
    }
  }
}

TEST(ParticleState, AStoredSceneSaysThatItLacksTheParticles) {
  ParticleState state;
  state.position = {{0.2, 0.2, 0.2}};
  state.material = {"matter"};
  const Simulation run(with_particles(spinning_block("jelly"), state));
  try {
    io::parse_stored_scene(run.header().scene_json, "stored", "run.h5");
    FAIL() << "the particles are not in the text";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("in memory are not stored"), std::string::npos) << error.what();
  }
}

TEST(ParticleState, InThePlaneNothingLeadsOutOfIt) {
  Scene scene = spinning_block("jelly");
  scene.domain.dimensions = 2;
  ParticleState state;
  state.position = {{0.2, 0.2, 5}, {0.3, 0.2, 0}};  // the third coordinate is the plane's
  state.deformation_gradient.assign(2, Mat3d::identity());
  state.material = {"matter"};
  const Simulation run(with_particles(scene, state));
  EXPECT_FLOAT_EQ(run.position()[0][2], 0.24f);
  state.deformation_gradient[1](2, 2) = 1.1;
  EXPECT_THROW(with_particles(scene, state), ConfigError);
}

TEST(PublicSimulation, SubstepsMakeTheFrame) {
  for (const char* change : {"frames=4", "time_step={\"policy\": \"adaptive\"}"}) {
    const Scene scene = spinning_block("sand", change);
    Simulation whole(scene), pieces(scene);
    for (int frame = 0; frame < 3; ++frame) {
      whole.advance_frame();
      while (!pieces.advance_substep()) EXPECT_LT(pieces.time(), whole.time());
    }
    EXPECT_EQ(pieces.substeps(), whole.substeps());
    EXPECT_EQ(pieces.time(), whole.time());
    EXPECT_TRUE(std::equal(whole.position().begin(), whole.position().end(), pieces.position().begin()));
    pieces.advance_substep();
    const double inside = pieces.time();
    EXPECT_GT(inside, whole.time());
    pieces.advance_frame();  // to the end of the frame that was begun
    whole.advance_frame();
    EXPECT_EQ(pieces.time(), whole.time());
    EXPECT_TRUE(std::equal(whole.position().begin(), whole.position().end(), pieces.position().begin()));
  }
}

TEST(PublicSimulation, SharedFramesOutliveTheRun) {
  std::shared_ptr<const ParticleFrame> start;
  Vec3f before;
  {
    Simulation run(spinning_block("jelly"));
    start = run.shared_frame();
    before = start->position[3];
    run.advance_frame();
    EXPECT_FALSE(run.position()[3] == before);
  }
  EXPECT_EQ(start->position[3], before);
}

}  // namespace
}  // namespace graupel
