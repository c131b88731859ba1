// Training of reduced-order models: decomposition, branches, and a small sweep from snapshots to rollouts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/random.h"
#include "io/scene_reader.h"
#include "io/trajectory_file.h"
#include "mpm/simulation.h"
#include "rom/reduced_solver.h"
#include "train/map_fit.h"
#include "train/nsf_training.h"
#include "train/pod.h"

namespace graupel::train {
namespace {

namespace fs = std::filesystem;

double noise(uint64_t i) { return Random(3, RandomPurpose::test).uniform(i, 0, -1, 1); }

/// Snapshots of rank 3 about a mean.
std::vector<float> low_rank(int snapshots, int width) {
  std::vector<float> values(static_cast<std::size_t>(snapshots * width));
  for (int i = 0; i < snapshots; ++i)
    for (int j = 0; j < width; ++j) {
      double x = 0.3 * j / width;
      for (int k = 0; k < 3; ++k)
        x += std::pow(0.3, k) * noise(static_cast<uint64_t>(1000 * k + i)) *
             noise(static_cast<uint64_t>(50000 + 10000 * k + j));
      values[static_cast<std::size_t>(i * width + j)] = static_cast<float>(x);
    }
  return values;
}

TEST(Pod, FindsAllModesOfLowRankSnapshots) {
  const std::vector<float> values = low_rank(20, 6000);  // more than one block of columns
  const SnapshotMatrix snapshots(values.data(), 20, 6000);
  const Pod modes = pod(snapshots, 10);
  ASSERT_GE(modes.modes(), 3);
  EXPECT_LT(modes.tail(3), 1e-3);  // the rounding of f32 products
  EXPECT_GT(modes.tail(2), 1e-3);
  double worst = 0;
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 6000; ++j) {
      double x = static_cast<double>(modes.mean[static_cast<std::size_t>(j)]);
      for (int k = 0; k < 3; ++k)
        x += modes.coefficients(i, k) *
             static_cast<double>(modes.basis[static_cast<std::size_t>(j * modes.modes() + k)]);
      worst = std::max(worst, std::abs(x - static_cast<double>(snapshots(i, j))));
    }
  EXPECT_LT(worst, 1e-5);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(modes.coefficients.col(k).squaredNorm() / 20, 1, 1e-9);
}

TEST(Pod, ProjectionReturnsCoefficients) {
  const std::vector<float> values = low_rank(20, 900);
  const SnapshotMatrix snapshots(values.data(), 20, 900);
  const Pod modes = pod(snapshots, 3);
  std::vector<float> rows = values;
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] -= modes.mean[i % 900];
  const Eigen::MatrixXd again = project(SnapshotMatrix(rows.data(), 20, 900), modes, 3);
  EXPECT_LT((again - modes.coefficients).cwiseAbs().maxCoeff(), 1e-4);
}

/// Points of `runs` runs along a curve, and a smooth function of them.
struct Curves {
  Eigen::MatrixXd inputs, rates, outputs;
  std::vector<int> run;
  Curves(int runs, int points, bool times_rate)
      : inputs(runs * points, 3), rates(runs * points, 2), outputs(runs * points, 2) {
    for (int r = 0; r < runs; ++r)
      for (int i = 0; i < points; ++i) {
        const double t = static_cast<double>(i) / points, mu = static_cast<double>(r) / runs;
        const Eigen::Index n = r * points + i;
        inputs.row(n) << std::sin(2 * t) + 0.1 * mu, t * t, mu;
        rates.row(n) << std::cos(3 * t), 1 + mu * t;
        const double a = std::exp(inputs(n, 0)) + mu, b = inputs(n, 1) * mu;
        outputs.row(n) << (times_rate ? a * rates(n, 0) + rates(n, 1) : a), (times_rate ? b * rates(n, 1) : b);
        run.push_back(r);
      }
  }
};

TEST(MapFit, PredictsSmoothFunctionsOfRunsInBetween) {
  const Curves curves(9, 25, false);
  for (const int centers : {60, 1000}) {
    const MapFit fit = fit_map(curves.inputs, curves.outputs, curves.run, centers);
    EXPECT_LT(fit.held_out_error, 0.01) << centers;
    double worst = 0;
    for (Eigen::Index i = 0; i < curves.inputs.rows(); ++i) {
      const std::vector<double> z = {curves.inputs(i, 0), curves.inputs(i, 1), curves.inputs(i, 2)};
      double c[2];
      fit.map.evaluate(z.data(), c);
      for (int k = 0; k < 2; ++k) worst = std::max(worst, std::abs(c[k] - curves.outputs(i, k)));
    }
    EXPECT_LT(worst, 0.03) << centers;
  }
}

TEST(MapFit, RateMapsAreLinearInTheRates) {
  const Curves curves(9, 25, true);
  const MapFit fit = fit_rate_map(curves.inputs, curves.rates, curves.outputs, curves.run, 20);
  EXPECT_LT(fit.held_out_error, 0.02);
  const std::vector<double> z = {curves.inputs(40, 0), curves.inputs(40, 1), curves.inputs(40, 2)};
  double m[4];
  fit.map.evaluate(z.data(), m);
  for (int k = 0; k < 2; ++k)
    EXPECT_NEAR(m[2 * k] * curves.rates(40, 0) + m[2 * k + 1] * curves.rates(40, 1), curves.outputs(40, k), 0.05);
}

/// A falling and spreading column of sand; its friction angle is varied.
Scene column(double angle) {
  return io::parse_scene(R"({
    "name": "column", "domain": { "size": [0.5, 0.5, 0.5], "dx": 0.02, "walls": "stick" },
    "gravity": [0, -4, 0],
    "materials": { "sand": { "preset": "nsf_sand", "friction_angle": 30 } },
    "sources": [ { "shape": "box", "size": [0.08, 0.12, 0.08], "position": [0.25, 0.121, 0.25], "material": "sand" } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 4 },
    "frames": 25, "frame_time": 0.016, "seed": 3 })",
                         "scene", "", {"materials.sand.friction_angle=" + std::to_string(angle)});
}

Trajectory run_of(const Scene& scene) {
  const auto simulation = mpm::Simulation::create(scene, {.seed = scene.seed});
  const FieldSet fields = {ParticleField::stress, ParticleField::affine};
  Trajectory trajectory;
  trajectory.particle_type = simulation->particle_type();
  trajectory.frame_time = scene.frame_time;
  trajectory.scene_json = io::scene_to_json(scene);
  trajectory.seed = scene.seed;
  trajectory.frames.push_back(mpm::frame_with_fields(*simulation, fields));
  for (int64_t f = 0; f < scene.frames; ++f) {
    simulation->advance_frame();
    trajectory.frames.push_back(mpm::frame_with_fields(*simulation, fields));
  }
  return trajectory;
}

class NsfTraining : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(GRAUPEL_BINARY_DIR) / "nsf_test_data";
    fs::create_directories(folder_);
    std::vector<std::string> parts;
    for (int i = 0; i < 7; ++i) {
      const double angle = 24 + 2 * i;
      const Trajectory run = run_of(column(angle));
      parts.push_back((folder_ / ("part" + std::to_string(i) + ".h5")).string());
      io::TrajectoryWriteOptions options;
      options.fields = {ParticleField::stress, ParticleField::affine};
      io::TrajectoryWriter writer(parts.back(), run, options);
      writer.parameters({{"friction_angle", "degrees", angle, {"materials.sand.friction_angle"}}});
      for (const ParticleFrame& frame : run.frames) writer.append(frame);
      writer.finish();
    }
    io::merge_trajectories(parts, (folder_ / "train.h5").string());
  }

  static NsfTrainingOptions options() {
    NsfTrainingOptions options;
    options.data = folder_.string();
    options.config.deformation_modes = 20;
    options.config.stress_modes = 30;
    options.config.affine_modes = 30;
    options.config.samples = 120;
    return options;
  }

  /// Root of the sum of squared errors over that of squared displacements, over all frames.
  template <typename T>
  static double displacement_error(const rom::ReducedModel& model, double angle, const rom::ReducedOptions& options) {
    const Scene scene = column(angle);
    const Trajectory truth = run_of(scene);
    rom::ReducedSolver<T> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {angle}, options);
    double error2 = 0, way2 = 0;
    for (std::size_t f = 1; f < truth.frames.size(); ++f) {
      solver.advance_frame();
      const ParticleFrame frame = solver.frame();
      for (std::size_t p = 0; p < frame.position.size(); ++p) {
        error2 += norm2((frame.position[p] - truth.frames[f].position[p]).cast<double>());
        way2 += norm2((truth.frames[f].position[p] - truth.frames[0].position[p]).cast<double>());
      }
    }
    return std::sqrt(error2 / way2);
  }

  static inline fs::path folder_;
};

TEST_F(NsfTraining, RollsOutAParameterThatItWasNotTrainedOn) {
  NsfReport report;
  const rom::ReducedModel model = train_factored(options(), report);
  EXPECT_EQ(report.snapshots, 7 * 26);
  EXPECT_LT(report.deformation.tail, 0.01);
  EXPECT_LT(displacement_error<float>(model, 29, {}), 0.03);
  EXPECT_LT(displacement_error<double>(model, 29, {}), 0.03);
}

/// The record on trust of a whole run.
rom::TrustRecord record_of(const rom::ReducedModel& model, const Scene& scene, double angle) {
  rom::ReducedSolver<float> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {angle}, {});
  rom::TrustRecord record(model.usual);
  for (int64_t f = 0; f < scene.frames; ++f) {
    solver.advance_frame();
    record.add(solver.trust());
  }
  return record;
}

TEST_F(NsfTraining, TrustsWhatItKnowsAndNotAStateThatLeavesIt) {
  NsfReport report;
  const rom::ReducedModel model = rom::ReducedModel::load(train_factored(options(), report).store(nn::DType::f32));
  EXPECT_EQ(report.calibration.runs, 4);
  EXPECT_EQ(report.calibration.errors.size(), 4u);
  ASSERT_EQ(model.usual.size(), 25u);
  EXPECT_NEAR(model.usual_error, *std::max_element(report.calibration.errors.begin(), report.calibration.errors.end()),
              1e-12);
  EXPECT_LE(record_of(model, column(24), 24).number(), 1.01);  // of the calibration
  EXPECT_EQ(record_of(model, column(29), 29).verdict(), rom::Verdict::ok);
  Scene pushed = column(29);
  pushed.gravity = {3, -4, 0};  // no training run moves sideways
  EXPECT_EQ(record_of(model, pushed, 29).verdict(), rom::Verdict::do_not_trust);
  NsfTrainingOptions without = options();
  without.config.calibration_runs = 0;
  NsfReport none;
  EXPECT_EQ(record_of(train_factored(without, none), column(24), 24).verdict(), rom::Verdict::unknown);
}

TEST_F(NsfTraining, KeepsTheDecayOfTheModes) {
  NsfReport report;
  const auto values = rom::ReducedModel::load(train_factored(options(), report).store(nn::DType::f32)).singular_values;
  for (const char* field : {"deformation", "stress", "affine"}) {
    const std::vector<float>& falling = values.at(field);
    ASSERT_EQ(falling.size(), 7u * 26);
    EXPECT_TRUE(std::is_sorted(falling.rbegin(), falling.rend())) << field;
  }
}

TEST_F(NsfTraining, KeepsStressAtTheIntegrationPointsOnly) {
  NsfReport report;
  NsfTrainingOptions few = options();
  few.config.cluster = 3;
  const rom::ReducedModel model = train_factored(few, report);
  EXPECT_EQ(model.fields->stress().rows(), model.clusters.count);
  EXPECT_LT(model.clusters.count, model.fields->particles() / 2);
  EXPECT_LT(displacement_error<double>(rom::ReducedModel::load(model.store(nn::DType::f16)), 29, {}), 0.1);
}

TEST_F(NsfTraining, SurvivesStorageAndTakesClustersAndLongerSteps) {
  NsfReport report;
  rom::ReducedModel model = train_factored(options(), report);
  const double own = displacement_error<double>(model, 31, {});
  const rom::ReducedModel stored = rom::ReducedModel::load(model.store(nn::DType::f32));
  EXPECT_NEAR(displacement_error<double>(stored, 31, {}), own, 0.2 * own);
  EXPECT_LT(displacement_error<double>(rom::ReducedModel::load(model.store(nn::DType::f16)), 31, {}), 0.03);
  rom::ReducedOptions longer;
  longer.step_factor = 2;
  EXPECT_LT(displacement_error<double>(stored, 31, longer), 0.1);
  model.take_clusters(rom::make_clusters(SnapshotSet((folder_ / "train.h5").string()).reference(),
                                         std::vector<int32_t>(static_cast<std::size_t>(model.fields->particles())), 3));
  EXPECT_EQ(model.fields->stress().rows(), model.clusters.count);
  EXPECT_LT(displacement_error<double>(model, 31, {}), 0.1);
  EXPECT_THROW(model.take_clusters({}), ConfigError);
}

TEST_F(NsfTraining, RefusesWhatIsNoSweep) {
  EXPECT_THROW(SnapshotSet("no_such_file.h5"), InputError);
  const Trajectory run = run_of(column(30));
  const std::string bare = (folder_ / "bare.h5").string();
  io::TrajectoryWriter writer(bare, run);
  for (const ParticleFrame& frame : run.frames) writer.append(frame);
  writer.finish();
  try {
    SnapshotSet set(bare);
    FAIL() << "accepted a run without stress";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("lacks the field 'stress'"), std::string::npos) << error.what();
  }
  NsfTrainingOptions many = options();
  many.config.latents = 32;
  many.config.deformation_modes = 20;
  NsfReport report;
  EXPECT_THROW(train_factored(many, report), ConfigError);
}

}  // namespace
}  // namespace graupel::train
