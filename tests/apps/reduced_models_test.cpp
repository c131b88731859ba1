// Reduced-order models through the verbs that graph networks go through: rollout and compare, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/models/refined_body.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/falling_model.h"
#include "tests/apps/program.h"
#include "tests/gpu_only.h"
#include "tests/rom/deformation_model.h"

namespace graupel::test {
namespace {

/// A scene of falling sand, and the weights of the model that is exact for it.
class ReducedModels : public ::testing::Test {
 protected:
  void SetUp() override { use_gravity(-9.8); }

  void use_gravity(double gravity) {
    scene_ = folder_.write("falling.json", falling_scene(gravity));
    model_ = folder_.file("falling.safetensors");
    nn::write_safetensors(model_, falling_model(io::read_scene(scene_)).store(nn::DType::f32));
  }

  Outcome rollout(const std::string& flags, const std::string& input = "") const {
    return graupel("rollout " + model_ + " " + (input.empty() ? scene_ : input) + " -o " + folder_.file("out.h5") +
                   " --json " + folder_.file("out.json") + " " + flags);
  }
  Trajectory predicted() const { return io::TrajectoryReader(folder_.file("out.h5")).read(0); }
  nlohmann::json summary(const std::string& name = "out.json") const {
    return nlohmann::json::parse(read_file(folder_.file(name)));
  }

  /// How far symplectic Euler falls in n steps of dt [m].
  static double fallen(int n, double dt) { return -9.8 * dt * dt * n * (n + 1) / 2; }

  Folder folder_;
  std::string scene_, model_;
};

TEST_F(ReducedModels, ARolloutFollowsTheLawOfFalling) {
  const Outcome outcome = rollout("--threads 1 --f64");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("integration particles") && outcome.says("decode") && outcome.says("trust"))
      << outcome.output;
  const Trajectory run = predicted();
  ASSERT_EQ(run.frames.size(), 9u);
  const double dt = 1.0 / 60 / falling_steps;
  for (std::size_t f = 0; f < run.frames.size(); ++f) {
    const int n = static_cast<int>(f) * falling_steps;
    ASSERT_EQ(run.frames[f].velocity.size(), run.particle_count());
    for (std::size_t p = 0; p < run.particle_count(); ++p) {
      EXPECT_NEAR(run.frames[f].position[p][1] - run.frames[0].position[p][1], fallen(n, dt), 1e-6);
      EXPECT_NEAR(run.frames[f].velocity[p][1], -9.8 * dt * n, 1e-5);
      EXPECT_NEAR(run.frames[f].velocity[p][0], 0, 1e-6);
    }
  }
  EXPECT_EQ(summary()["steps"], 8 * falling_steps);
  EXPECT_EQ(summary()["diverged_at_frame"], -1);
}

TEST_F(ReducedModels, EveryFrameSaysHowFarItIsFromTheTraining) {
  ASSERT_EQ(rollout("--threads 1 --f64").exit_code, 0);
  const auto file = io::hdf5::open_file(folder_.file("out.h5"));
  const auto size = std::filesystem::file_size(folder_.file("out.h5"));
  const auto trust = io::hdf5::open_dataset(file, "00000/trust", 2, io::hdf5::NumberKind::real, size);
  ASSERT_EQ(trust.size, (std::vector<hsize_t>{9, 4}));
  std::vector<float> rows(36);
  trust.read_rows(0, 9, io::hdf5::Element::float32, rows.data());
  const double dt = 1.0 / 60 / falling_steps;
  for (int f = 1; f < 9; ++f) {
    const double q = fallen(f * falling_steps, dt);
    const double distance = std::min(std::abs(q), std::abs(q - falling_training_low)) / falling_reach;
    EXPECT_NEAR(rows[static_cast<std::size_t>(4 * f + 2)], distance, 1e-5 * (1 + distance)) << f;
  }
  EXPECT_NEAR(summary()["trust"]["latent_distance"].get<double>(), rows[34], 1e-5);
  EXPECT_EQ(rows[0], 0);
}

TEST_F(ReducedModels, ATrajectoryGivesItsSceneAndSeed) {
  ASSERT_EQ(graupel("simulate " + scene_ + " -o " + folder_.file("truth.h5")).exit_code, 0);
  ASSERT_EQ(rollout("--threads 1").exit_code, 0);
  const Trajectory from_scene = predicted();
  const Outcome outcome = rollout("--threads 1", folder_.file("truth.h5"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Trajectory from_trajectory = predicted();
  ASSERT_EQ(from_trajectory.frames.size(), from_scene.frames.size());
  EXPECT_EQ(from_trajectory.frames.back().position, from_scene.frames.back().position);
  EXPECT_EQ(from_trajectory.seed, from_scene.seed);
  ASSERT_EQ(rollout("--frames 2 --trajectory 1", folder_.file("truth.h5")).exit_code, 2);
}

TEST_F(ReducedModels, LongerStepsAndDoublePrecision) {
  ASSERT_EQ(rollout("--frames 4 --step-factor 2 --f64 --threads 1").exit_code, 0);
  EXPECT_EQ(summary()["steps"], 4 * falling_steps / 2);
  const Trajectory run = predicted();
  EXPECT_NEAR(run.frames[4].position[0][1] - run.frames[0].position[0][1],
              fallen(2 * falling_steps, 2.0 / 60 / falling_steps), 1e-6);
}

/// The model knows the way down alone.
TEST_F(ReducedModels, LoadsPushTheBody) {
  ASSERT_EQ(rollout("--frames 4 --threads 1").exit_code, 0);
  const Trajectory free = predicted();
  const Outcome outcome =
      rollout("--frames 4 --threads 1 --load 0.01:1:0.5,0.5,0.5:9:0,5,0 --load 0:1:0.5,0.5,0.5:9:5,0,0");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("particles carry it")) << outcome.output;
  const Trajectory pushed = predicted();
  EXPECT_GT(pushed.frames[4].position[0][1], free.frames[4].position[0][1]);
  EXPECT_EQ(pushed.frames[4].position[0][0], free.frames[4].position[0][0]);
  for (const char* load : {"0:1:0,0,0:1:1,0", "0:1:0,0,0:1:1,0,0,", "0:1:0,0,0:1:1,0,x", "", "-1:1:0,0,0:1:1,0,0",
                           "99:1:0.5,0.5,0.5:9:1,0,0"}) {
    const Outcome refused = rollout(std::string("--load '") + load + "'");
    EXPECT_EQ(refused.exit_code, 2) << load << ": " << refused.output;
    EXPECT_TRUE(refused.says("--load")) << refused.output;
  }
  for (const char* load : {"0:1:0.5,0.5,0.5:0:1,0,0", "0:0:0.5,0.5,0.5:9:1,0,0", "0:1:9,9,9:0.1:1,0,0"})
    EXPECT_EQ(rollout(std::string("--load ") + load).exit_code, 2) << load;
}

TEST_F(ReducedModels, ARefinedBodyFallsWithItsParticles) {
  ASSERT_EQ(rollout("--threads 1 --f64").exit_code, 0);
  const Trajectory particles = predicted();
  const Outcome outcome = rollout("--threads 1 --f64 --refine 20 --stride 3");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("refined to")) << outcome.output;
  const Trajectory points = predicted();
  const std::size_t n = particles.particle_count();
  ASSERT_EQ(points.particle_count(), 20 * n);
  ASSERT_EQ(points.frames.size(), 3u);  // 0, 3 and 6 of 8
  EXPECT_DOUBLE_EQ(points.frame_time, 3 * particles.frame_time);
  for (std::size_t f = 0; f < points.frames.size(); ++f) {
    EXPECT_DOUBLE_EQ(points.frames[f].time, particles.frames[3 * f].time);
    EXPECT_TRUE(points.frames[f].velocity.empty());
    for (std::size_t i = 0; i < points.particle_count(); ++i) {
      EXPECT_EQ(points.particle_type[i], particles.particle_type[i / 20]);
      const Vec3f d = points.frames[f].position[i] - particles.frames[3 * f].position[i / 20];
      for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(d[c]), 0.51f * 0.03125f / 2);  // 8 particles a cell
    }
  }
  EXPECT_EQ(summary()["points"], 20 * n);
  EXPECT_EQ(summary()["frames_written"], 3);
}

TEST_F(ReducedModels, AreComparedAmongMovingObstaclesAndScriptedParticles) {
  const auto compared = [&](const std::string& scene, const std::string& model, const std::string& settings) {
    const Outcome outcome =
        graupel("compare --scenes scenes/nsf/" + scene + ".json --models mpm,models/" + model +
                ".safetensors --frames 8 --no-floors --json " + folder_.file("compared.json") + settings);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    return nlohmann::json::parse(read_file(folder_.file("compared.json")));
  };
  const nlohmann::json metal = compared("metal", "nsf-metal",
                                        " --set domain.dx=0.0227 --set time_step.substeps_per_frame=5 --set "
                                        "materials.metal.hardening_modulus=0.276923");
  EXPECT_LT(metal.at("mean").at("models/nsf-metal.safetensors").at("delta"), 0.002);
  const nlohmann::json jelly = compared("jelly", "nsf-jelly",
                                        " --set domain.dx=0.0333333333333 --set 'domain.origin=[0, -0.042, 0]' --set "
                                        "sources.0.velocity.0=0.385");
  EXPECT_LT(jelly.at("mean").at("models/nsf-jelly.safetensors").at("delta"), 0.002);
}

TEST_F(ReducedModels, RefinedBodiesThatDoNotFitAreRefused) {
  EXPECT_EQ(rollout("--refine 0").exit_code, 2);
  EXPECT_EQ(rollout("--stride 0").exit_code, 2);
  const Outcome outcome = graupel("rollout models/nsf-sand.safetensors scenes/shared/sand_column.json -o " +
                                  folder_.file("huge.h5") + " --refine 1000000");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
  EXPECT_TRUE(outcome.says("--refine 1000000 makes 9866000000 points")) << outcome.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("huge.h5.part")));
  EXPECT_NO_THROW(experiments::check_refined_size(1000, 100, 20'000'000));
  try {
    experiments::check_refined_size(1000, 100, 10'000'000);
    FAIL() << "accepted points that do not fit into memory";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("100000 points, which need about 0.013 GB"), std::string::npos)
        << error.what();
  }
}

TEST_F(ReducedModels, ADivergedRolloutKeepsItsFrames) {
  use_gravity(-2000);  // over a cell a step in the second frame
  const Outcome outcome = rollout("--threads 1");
  EXPECT_EQ(outcome.exit_code, 4) << outcome.output;
  EXPECT_TRUE(outcome.says("diverged at frame 2")) << outcome.output;
  const Trajectory run = predicted();
  EXPECT_EQ(run.frames.size(), 2u);
  EXPECT_EQ(run.diverged_at_frame, 2);
}

TEST_F(ReducedModels, ParametersOutsideOfTheTrainingWarn) {
  const Outcome inside = rollout("--frames 1 --set materials.sand.friction_angle=38");
  EXPECT_EQ(inside.exit_code, 0) << inside.output;
  EXPECT_FALSE(inside.says("warning")) << inside.output;
  EXPECT_EQ(summary()["parameters"], std::vector<double>{38});
  const Outcome outside = rollout("--frames 1 --set materials.sand.friction_angle=45");
  EXPECT_EQ(outside.exit_code, 0) << outside.output;
  EXPECT_TRUE(outside.says("friction_angle = 45 degrees, trained on 30 to 40")) << outside.output;
}

TEST_F(ReducedModels, AnotherSceneIsRefusedByTheKeyThatDiffers) {
  const Outcome gravity = rollout("--set gravity=[0,-5,0]");
  EXPECT_EQ(gravity.exit_code, 2) << gravity.output;
  EXPECT_TRUE(gravity.says("/gravity/1") && gravity.says("falling.safetensors")) << gravity.output;
  const Outcome seed = rollout("--seed 77");
  EXPECT_EQ(seed.exit_code, 2) << seed.output;
  EXPECT_TRUE(seed.says("starts elsewhere")) << seed.output;
  const Outcome compare = graupel("compare --scenes " + scene_ + " scenes/shared/water_steps.json --models mpm," +
                                  model_ + " --json " + folder_.file("no.json"));
  EXPECT_EQ(compare.exit_code, 2) << compare.output;
  EXPECT_TRUE(compare.says("is for another scene")) << compare.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("no.json")));
}

/// A model of the deformation alone takes any load, and says so.
TEST_F(ReducedModels, OfTheDeformationAloneTakeOtherLoads) {
  const Scene scene = rom::test::jelly_block("[0, -9.8, 0]");
  Eigen::MatrixXd translation = Eigen::MatrixXd::Zero(3, 6);
  translation.rightCols(3).setIdentity();
  scene_ = folder_.write("block.json", io::scene_to_json(scene));
  model_ = folder_.file("block.safetensors");
  nn::write_safetensors(
      model_,
      rom::test::deformation_model(scene, rom::test::linear_network(translation), {0, 0, 0}).store(nn::DType::f32));
  const Outcome own = rollout("--threads 1 --f64");
  ASSERT_EQ(own.exit_code, 0) << own.output;
  EXPECT_FALSE(own.says("loads differ")) << own.output;
  for (const char* flags : {"--quadrature lagrangian --projection velocity", "--quadrature eulerian"}) {
    const Outcome other = rollout(std::string("--threads 1 --f64 --set gravity=[0,-5,0] ") + flags);
    ASSERT_EQ(other.exit_code, 0) << other.output;
    EXPECT_TRUE(other.says("loads differ") && other.says("/gravity/1")) << other.output;
    const Trajectory run = predicted();
    const int n = 16;
    EXPECT_NEAR(run.frames.back().position[0][1] - run.frames[0].position[0][1], -5 * 0.0025 * 0.0025 * n * (n + 1) / 2,
                1e-4)
        << flags;
  }
}

/// Its map knows every material point: the body may have other particles, on another grid, and finer output.
TEST_F(ReducedModels, OfTheDeformationAloneTakeOtherParticlesOfTheirBody) {
  Scene scene = rom::test::jelly_block("[0, -9.8, 0]");
  Eigen::MatrixXd translation = Eigen::MatrixXd::Zero(3, 6);
  translation.rightCols(3).setIdentity();
  scene_ = folder_.write("block.json", io::scene_to_json(scene));
  model_ = folder_.file("block.safetensors");
  rom::ReducedModel model = rom::test::deformation_model(scene, rom::test::linear_network(translation), {0, 0, 0});
  model.parameters = {{"gravity", "m/s^2", {"gravity.1"}, -10, -5}};
  nn::write_safetensors(model_, model.store(nn::DType::f32));
  const std::string finer = "--set domain.dx=0.035 --set sources.0.particles_per_cell=20 --seed 5 ";
  const int n = 16;
  const double fall = -9.8 * 0.0025 * 0.0025 * n * (n + 1) / 2;
  for (const char* flags : {"", "--quadrature eulerian ", "--refine 3 "}) {
    const Outcome outcome = rollout("--threads 1 --f64 " + finer + flags);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_TRUE(outcome.says("particles or grid differ") && outcome.says("/domain/dx")) << outcome.output;
    const Trajectory run = predicted();
    EXPECT_GT(run.particle_count(), 3 * model.reference.size() / 3);
    for (std::size_t p = 0; p < run.particle_count(); p += 100) {
      const Vec3f way = run.frames.back().position[p] - run.frames[0].position[p];
      EXPECT_NEAR(way[1], fall, 1e-4) << flags;
      EXPECT_NEAR(way[0], 0, 1e-5) << flags;
    }
  }

  const std::string recipe =
      folder_.write("sweep.json", R"({ "name": "falls", "scene": "block.json", "parameters": [ { "name": "gravity",
  "unit": "m/s^2", "key": "gravity.1", "values": [-5, -9.8, -10] } ] })");
  const std::string data = folder_.file("falls");
  ASSERT_EQ(graupel("generate " + recipe + " -o " + data).exit_code, 0);
  const Outcome compare =
      graupel("compare --scenes " + scene_ + " --models mpm," + model_ + " " + finer +
              "--no-floors --threads 1 --training-runs " + data + " --json " + folder_.file("compare.json"));
  ASSERT_EQ(compare.exit_code, 0) << compare.output;
  const auto results = summary("compare.json")["results"];
  ASSERT_EQ(results.size(), 5u);
  EXPECT_EQ(results[3]["note"], "gravity -9.8: this scene is a training run");
  for (const std::size_t i : {1u, 3u, 4u})
    EXPECT_LT(results[i]["displacement_relative_error"].get<double>(), 5e-3) << results[i]["model"];

  const Outcome longer = rollout("--set sources.0.size.0=0.25");
  EXPECT_EQ(longer.exit_code, 2) << longer.output;
  EXPECT_TRUE(longer.says("/sources/0/size/0")) << longer.output;
}

TEST_F(ReducedModels, CompareHoldsThemBesideMpm) {
  const Outcome outcome =
      graupel("compare --scenes " + scene_ + " --models mpm," + model_ +
              " --no-floors --threads 1 --set materials.sand.friction_angle=33 --json " + folder_.file("compare.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("Left out:")) << outcome.output;
  const std::string sentence = summary("compare.json")["reduced_models"][0];
  EXPECT_NE(sentence.find("its verdict on itself: unknown."), std::string::npos) << sentence;
  const auto results = summary("compare.json")["results"];
  ASSERT_EQ(results.size(), 3u);
  EXPECT_EQ(results[2]["model"], "nothing-moves");
  EXPECT_NEAR(results[2]["displacement_relative_error"].get<double>(), 1, 1e-9);
  EXPECT_EQ(results[0]["delta"], 0);
  EXPECT_EQ(results[0]["displacement_relative_error"], 0);
  const auto& model = results[1];
  EXPECT_EQ(model["model"], model_);
  EXPECT_EQ(model["one_step_source"], "own rollout");
  EXPECT_GT(model["displacement_relative_error"], 0);
  EXPECT_LT(model["displacement_relative_error"], 5e-3);  // single precision rounds all samples' steps alike
  EXPECT_LT(model["delta"].get<double>(), model["displacement_relative_error"].get<double>());
  EXPECT_LT(model["one_step_mse"].get<double>(), 1e-4 * model["one_step_mse_zero"].get<double>());
  EXPECT_EQ(model["substeps_per_frame"], falling_steps);
  const double frame = model["frame_ms"], parts = model["network_ms"].get<double>() +
                                                  model["grid_build_ms"].get<double>() +
                                                  model["features_ms"].get<double>();
  EXPECT_GT(model["network_ms"], 0);
  EXPECT_GT(model["grid_build_ms"], 0);
  EXPECT_LT(parts, 1.5 * frame);
  EXPECT_GT(parts, 0.3 * frame);
}

/// Sand that falls freely does so at every friction angle: the training runs know the answer.
TEST_F(ReducedModels, CompareHoldsThemBesideTheirTrainingRuns) {
  const std::string recipe = folder_.write(
      "sweep.json",
      R"({ "name": "angles", "scene": "falling.json", "test": [1], "parameters": [ { "name": "friction_angle",
  "unit": "degrees", "key": "materials.sand.friction_angle", "values": [30, 33, 40] } ] })");
  const std::string data = folder_.file("data");
  ASSERT_EQ(graupel("generate " + recipe + " -o " + data).exit_code, 0);
  const auto compare = [&](const std::string& flags) {
    return graupel("compare --models mpm," + model_ + " --no-floors --threads 1 --training-runs " + data + " --json " +
                   folder_.file("compare.json") + " " + flags);
  };
  const Outcome inside = compare("--split test --scenes " + data);
  ASSERT_EQ(inside.exit_code, 0) << inside.output;
  auto results = summary("compare.json")["results"];
  ASSERT_EQ(results.size(), 5u);
  EXPECT_EQ(results[3]["model"], "nearest-run");
  EXPECT_EQ(results[3]["note"], "friction_angle 30");
  EXPECT_EQ(results[4]["model"], "between-runs");
  for (const int i : {3, 4}) EXPECT_LT(results[static_cast<std::size_t>(i)]["displacement_relative_error"], 1e-5);
  EXPECT_GT(results[1]["model_memory_mib"], 0);
  const Outcome outside = compare("--scenes " + scene_ + " --set materials.sand.friction_angle=45");
  ASSERT_EQ(outside.exit_code, 0) << outside.output;
  EXPECT_TRUE(outside.says("outside the training: friction_angle = 45")) << outside.output;
  results = summary("compare.json")["results"];
  EXPECT_EQ(results[4]["model"], "beyond-runs");
  EXPECT_EQ(results[1]["remarks"].size(), 1u);

  const Outcome known = compare("--scenes " + scene_ + " --frames 2 --set materials.sand.friction_angle=40");
  ASSERT_EQ(known.exit_code, 0) << known.output;
  results = summary("compare.json")["results"];
  EXPECT_EQ(results[3]["note"], "friction_angle 40: this scene is a training run");
  EXPECT_EQ(results[4]["note"], "friction_angle 1 x 40");

  const Outcome longer = compare("--scenes " + scene_ + " --frames 9");
  EXPECT_EQ(longer.exit_code, 2) << longer.output;
  EXPECT_TRUE(longer.says("the number of frames is 9 in the scene and at most 8 in the runs")) << longer.output;
  const Outcome slower = compare("--scenes " + scene_ + " --set frame_time=0.02");
  EXPECT_EQ(slower.exit_code, 2) << slower.output;
  EXPECT_TRUE(slower.says("/frame_time")) << slower.output;
  const Outcome without = graupel("compare --scenes " + scene_ + " --models mpm --training-runs " + data);
  EXPECT_EQ(without.exit_code, 2) << without.output;
  EXPECT_TRUE(without.says("--models names none")) << without.output;

  folder_.write("falling.json", falling_scene(-5));  // of which other training runs are made
  ASSERT_EQ(graupel("generate " + recipe + " -o " + folder_.file("other")).exit_code, 0);
  folder_.write("falling.json", falling_scene(-9.8));
  const Outcome foreign =
      graupel("compare --scenes " + scene_ + " --models mpm," + model_ + " --training-runs " + folder_.file("other"));
  EXPECT_EQ(foreign.exit_code, 2) << foreign.output;
  EXPECT_TRUE(foreign.says("/gravity/1") && foreign.says("--training-runs")) << foreign.output;
}

TEST_F(ReducedModels, FlagsOfTheOtherKindAreRefused) {
  for (const char* flag : {"--no-project", "--no-free-flight", "--density-limit 1", "--start truth:6"}) {
    const Outcome outcome = rollout(flag);
    EXPECT_EQ(outcome.exit_code, 2) << flag << ": " << outcome.output;
    EXPECT_TRUE(outcome.says(std::string(flag).substr(0, 7))) << outcome.output;
  }
  for (const char* flag : {"--step-factor 2", "--f64", "--refine 2", "--stride 2", "--load 0:1:0,0,0:1:1,0,0"}) {
    const Outcome outcome = graupel("rollout models/hgn.safetensors " + scene_ + " -o " + folder_.file("a.h5 ") + flag);
    EXPECT_EQ(outcome.exit_code, 2) << flag << ": " << outcome.output;
    EXPECT_TRUE(outcome.says("graph network")) << outcome.output;
  }
  const Outcome one_step = graupel("compare --scenes " + scene_ + " --models mpm," + model_ + " --one-step-only");
  EXPECT_EQ(one_step.exit_code, 2) << one_step.output;
  EXPECT_TRUE(one_step.says("no one-step error without a rollout")) << one_step.output;
  EXPECT_EQ(rollout("--step-factor 0").exit_code, 2);
}

TEST_F(ReducedModels, WithoutAGpuCudaIsRefused) {
  if (cuda_available()) GTEST_SKIP() << "there is a GPU here";
  const Outcome outcome = rollout("--device cuda");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
  EXPECT_TRUE(outcome.says("cuda")) << outcome.output;
}

TEST_F(ReducedModels, RunOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const Outcome f64 = rollout("--device cuda --f64");
  EXPECT_EQ(f64.exit_code, 2) << f64.output;
  const Outcome outcome = rollout("--device cuda");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("on the GPU")) << outcome.output;
  const Trajectory run = predicted();
  ASSERT_EQ(run.frames.size(), 9u);
  const double dt = 1.0 / 60 / falling_steps;
  for (std::size_t f = 0; f < run.frames.size(); ++f)
    for (std::size_t p = 0; p < run.particle_count(); ++p)
      EXPECT_NEAR(run.frames[f].position[p][1] - run.frames[0].position[p][1],
                  fallen(static_cast<int>(f) * falling_steps, dt), 2e-6 + 1e-4 * static_cast<double>(f * f) / 64);
  const Outcome compare = graupel("compare --scenes " + scene_ + " --models mpm," + model_ +
                                  " --no-floors --device cuda --json " + folder_.file("compare.json"));
  ASSERT_EQ(compare.exit_code, 0) << compare.output;
  EXPECT_LT(summary("compare.json")["results"][1]["displacement_relative_error"], 1e-2);
}

TEST_F(ReducedModels, ADamagedSceneOfTheTrainingIsAFaultOfTheWeights) {
  nn::Weights weights = nn::read_safetensors(model_);
  for (const std::string& scene :
       {std::string("{ \"frames\": -1 }"), std::string("{"), weights.metadata["scene"].substr(9)}) {
    weights.metadata["scene"] = scene;
    nn::write_safetensors(model_, weights);
    for (const Outcome& outcome : {rollout(""), graupel("compare --models " + model_ + " --scenes " + scene_)}) {
      EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
      EXPECT_TRUE(outcome.says("falling.safetensors': the scene stored in it is damaged")) << outcome.output;
      EXPECT_TRUE(outcome.says("Train again, or copy the file anew")) << outcome.output;
    }
  }
}

TEST_F(ReducedModels, DamagedAndForeignWeightsAreNamed) {
  const std::string bytes = read_file(model_);
  const auto cut = folder_.write("cut.safetensors", bytes.substr(0, bytes.size() - 50));
  const Outcome truncated = graupel("rollout " + cut + " " + scene_ + " -o " + folder_.file("a.h5"));
  EXPECT_EQ(truncated.exit_code, 3) << truncated.output;
  EXPECT_TRUE(truncated.says("cut.safetensors")) << truncated.output;
  const Outcome foreign = graupel("bench rom models/hgn.safetensors " + folder_.file("none"));
  EXPECT_EQ(foreign.exit_code, 3) << foreign.output;
  EXPECT_TRUE(foreign.says("no reduced-order model") && foreign.says("hgn")) << foreign.output;
}

}  // namespace
}  // namespace graupel::test
