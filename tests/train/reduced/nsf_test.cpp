// Training of reduced-order models: decomposition, branches, and a small sweep from snapshots to rollouts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "core/math/random.h"
#include "core/system/error.h"
#include "io/config/config_writer.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"
#include "rom/fields/factored_fields.h"
#include "rom/interpolation/mls_interpolation.h"
#include "rom/reduced_solver.h"
#include "tests/train/curves.h"
#include "tests/train/reduced/tiny_sweep.h"
#include "train/reduced/map_fit.h"
#include "train/reduced/nsf_training.h"
#include "train/reduced/pod.h"
#include "train/reduced/sweep_snapshots.h"

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
  MatrixBlocks whole(snapshots);
  const Pod modes = pod(whole, 10);
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

TEST(Pod, ModesOfEveryNthSnapshotHoldTheOthers) {
  constexpr Eigen::Index snapshots = 41, width = 6000, rank = 3;
  const std::vector<float> values = low_rank(snapshots, width);
  const SnapshotMatrix all(values.data(), snapshots, width);
  MatrixBlocks blocks(all);
  EveryNthBlocks some(blocks, 4);
  ASSERT_EQ(some.snapshots(), 11);
  EXPECT_EQ(some.load(0).row(10), all.row(40));
  const Pod modes = pod(some, rank);
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Rows rest = all.rowwise() - Eigen::Map<const Eigen::RowVectorXf>(modes.mean.data(), width);
  MatrixBlocks others(SnapshotMatrix(rest.data(), snapshots, width));
  const Rows coefficients = project(others, modes, rank).cast<float>();
  const SnapshotMatrix basis(modes.basis.data(), width, rank);
  EXPECT_LT((coefficients * basis.transpose() - rest).norm(), 1e-3f * rest.norm());
}

TEST(Pod, ProjectionReturnsCoefficients) {
  const std::vector<float> values = low_rank(20, 900);
  MatrixBlocks snapshots(SnapshotMatrix(values.data(), 20, 900));
  const Pod modes = pod(snapshots, 3);
  std::vector<float> rows = values;
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] -= modes.mean[i % 900];
  MatrixBlocks others(SnapshotMatrix(rows.data(), 20, 900));
  const Eigen::MatrixXd again = project(others, modes, 3);
  EXPECT_LT((again - modes.coefficients).cwiseAbs().maxCoeff(), 1e-4);
}

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

class NsfTraining : public testing::Test {
 protected:
  static void SetUpTestSuite() { folder_ = tiny_sweep("nsf_test_data"); }

  static NsfTrainingOptions options() {
    NsfTrainingOptions options;
    options.data = folder_;
    options.config.deformation_modes = 20;
    options.config.stress_modes = 30;
    options.config.affine_modes = 30;
    options.config.samples = 120;
    return options;
  }

  static const rom::FactoredFields& factored(const rom::ReducedModel& model) {
    return dynamic_cast<const rom::FactoredFields&>(*model.fields);
  }

  static inline std::string folder_;
};

TEST_F(NsfTraining, RollsOutAParameterThatItWasNotTrainedOn) {
  NsfReport report;
  const rom::ReducedModel model = train_factored(options(), report);
  EXPECT_EQ(report.snapshots, 7 * 26);
  EXPECT_LT(report.deformation.tail, 0.01);
  EXPECT_LT(displacement_error<float>(model, 29, {}), 0.03);
  EXPECT_LT(displacement_error<double>(model, 29, {}), 0.03);
}

TEST_F(NsfTraining, BlocksOfSnapshotsGiveTheSameModel) {
  NsfReport report;
  for (const auto& [cluster, affine] : {std::pair{1, rom::AffineKind::rate}, {2, rom::AffineKind::position}}) {
    NsfTrainingOptions whole = options();
    whole.config.cluster = cluster;
    whole.config.affine = affine;
    NsfTrainingOptions parts = whole;
    parts.config.memory = 1e-6;  // a piece of columns at a time
    int said = 0;
    parts.message = [&](const std::string& text) { said += text.find("blocks of snapshots") != std::string::npos; };
    const nn::Weights a = train_factored(whole, report).store(nn::DType::f32),
                      b = train_factored(parts, report).store(nn::DType::f32);
    EXPECT_GE(said, cluster == 1 ? 2 : 1);
    ASSERT_EQ(a.tensors.size(), b.tensors.size());
    for (const auto& [name, tensor] : a.tensors)
      EXPECT_EQ(tensor.bytes, b.tensors.at(name).bytes) << name << " with clusters of " << cluster;
  }
}

/// The record on trust of a whole run.
rom::ErrorIndicatorRecord record_of(const rom::ReducedModel& model, const Scene& scene, double angle) {
  rom::ReducedSolver<float> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {angle}, {});
  rom::ErrorIndicatorRecord record(model.usual);
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

TEST_F(NsfTraining, TrustsNoModelWhoseTrainingRunsDiverge) {
  NsfReport report;
  rom::ReducedModel model = rom::ReducedModel::load(train_factored(options(), report).store(nn::DType::f32));
  Scene thrown = column(28);  // its model's body leaves through the floor
  Trajectory run = run_of(thrown);
  thrown.gravity = {0, -1e6, 0};
  run.scene_json = io::scene_to_json(thrown);
  const std::string file = new_sweep_folder("nsf_test_thrown") + "/train.h5";
  io::TrajectoryWriter writer(file, run, {.fields = {ParticleField::stress, ParticleField::affine}});
  writer.parameters({{"friction_angle", "degrees", 28, {"materials.sand.friction_angle"}}});
  for (const ParticleFrame& frame : run.frames) writer.append(frame);
  writer.finish();
  CalibrationReport calibration;
  std::string said;
  calibrate_trust(model, {.file = file, .message = [&](const std::string& text) { said += text; }}, calibration);
  ASSERT_GT(calibration.diverged, 0);
  EXPECT_GE(model.usual_error, 1);
  EXPECT_FALSE(model.interpolation);
  EXPECT_NE(said.find("of them diverged"), std::string::npos) << said;
  EXPECT_EQ(rom::ErrorIndicatorRecord(model.usual, 0, model.usual_error).verdict(), rom::Verdict::do_not_trust);
}

/// In the range (24 to 36 degrees) the bound is little above the error, also with steps that nothing was calibrated at;
/// far outside of the range it is large.
TEST_F(NsfTraining, BoundsTheErrorOfRunsThatItHasNotSeen) {
  NsfReport report;
  const rom::ReducedModel model = rom::ReducedModel::load(train_factored(options(), report).store(nn::DType::f32));
  ASSERT_TRUE(model.interpolation);
  EXPECT_LT(model.interpolation->reconstruction, 0.01);
  rom::ReducedOptions rollout;
  const auto bound_of = [&](double angle) {
    const Scene scene = column(angle);
    rom::ReducedSolver<float> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {angle}, rollout);
    auto bound = rom::InterpolationBound::of(model, angle);
    for (int64_t f = 0; f < scene.frames; ++f) {
      solver.advance_frame();
      bound->add(solver.state().latent, solver.time());
    }
    return bound->value().value();
  };
  for (const double step_factor : {1.0, 2.0}) {
    rollout.step_factor = step_factor;
    const double error = displacement_error<float>(model, 29, rollout), bound = bound_of(29);
    EXPECT_GE(bound, error) << step_factor;
    EXPECT_LE(bound, error + 0.02) << step_factor;
  }
  EXPECT_GT(bound_of(50), rom::ErrorIndicatorRecord::doubtful_error);
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
  EXPECT_EQ(factored(model).stress().rows(), model.clusters.count);
  EXPECT_LT(model.clusters.count, model.fields->particles() / 2);
  EXPECT_LT(displacement_error<double>(rom::ReducedModel::load(model.store(nn::DType::f16)), 29, {}), 0.1);
}

/// Stress by the material's law knows the angle of friction without having been trained on others: here outside of the
/// training, 24 to 36 degrees.
TEST_F(NsfTraining, StressByTheMaterialsLawNeedsNoStressField) {
  NsfReport report;
  NsfTrainingOptions law = options();
  law.config.stress = StressKind::law;
  law.config.latents = law.config.deformation_modes = 16;
  law.config.samples = 100000;
  const rom::ReducedModel model = train_factored(law, report);
  EXPECT_FALSE(factored(model).has_stress());
  EXPECT_EQ(model.gradient, rom::GradientKind::integrated);
  const nn::Weights weights = model.store(nn::DType::f32);
  EXPECT_EQ(weights.tensors.count("stress.basis"), 0u);
  const rom::ReducedModel stored = rom::ReducedModel::load(weights);
  const double own = displacement_error<double>(model, 29, {});
  EXPECT_LT(own, 0.03);
  EXPECT_NEAR(displacement_error<double>(stored, 29, {}), own, 0.05 * own + 1e-4);
  EXPECT_LT(displacement_error<float>(stored, 44, {}), 0.06);

  law.config.cluster = 4;
  EXPECT_LT(displacement_error<float>(train_factored(law, report), 29, {}), 0.15);
}

TEST_F(NsfTraining, MatchesThePointsOfClusters) {
  NsfReport report;
  NsfTrainingOptions some = options();
  some.config.cluster = 6;
  bool said = false;
  some.message = [&](const std::string& text) { said = said || text.find("cluster points") == 0; };
  const rom::ReducedModel model = train_factored(some, report);
  EXPECT_TRUE(said);
  const rom::ReducedModel stored = rom::ReducedModel::load(model.store(nn::DType::f32));
  EXPECT_EQ(stored.clusters.representatives(), model.clusters.points);
  std::vector<double> volume(static_cast<std::size_t>(model.fields->particles()), 2e-6);
  const rom::GridParticles points = stored.integration_points(volume);
  EXPECT_NEAR(std::accumulate(points.weight.begin(), points.weight.end(), 0.0), static_cast<double>(volume.size()),
              1e-9 * static_cast<double>(volume.size()));
  EXPECT_LT(displacement_error<float>(stored, 29, {}), 0.1);

  some.config.cluster_point = ClusterPoint::random;
  const rom::ReducedModel random = train_factored(some, report);
  EXPECT_TRUE(random.clusters.points.empty());
  EXPECT_NE(random.clusters.representatives(), model.clusters.points);
}

TEST(NsfConfigKeys, ThatWereRemovedAreReadAtTheirDefaultsAndRefusedOtherwise) {
  const auto read = [](const std::string& text) { return io::read_config<NsfConfig>(text, "nsf.json"); };
  EXPECT_EQ(
      read(R"({"quadrature": "mass", "sample_windows": [], "between_runs": 0, "outlier_factor": 0.0, "samples": 7})")
          .samples,
      7);
  EXPECT_EQ(read(R"({"outlier_factor": 0})").samples, NsfConfig().samples);
  for (const std::string setting : {R"("quadrature": "fitted")", R"("between_runs": 2)", R"("outlier_factor": 3.5)",
                                    R"("sample_windows": [{"time": 0.1, "samples": 40}])"})
    try {
      read("{" + setting + "}");
      FAIL() << setting;
    } catch (const ConfigError& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find("was removed"), std::string::npos) << what;
      EXPECT_NE(what.find("nsf.json"), std::string::npos) << what;
    }
  try {
    read(R"({"sample_rule": "optimal"})");
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("spread"), std::string::npos) << error.what();
  }
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
  model.take_clusters(rom::make_clusters(SnapshotSet(folder_ + "/train.h5", nsf_fields).reference(),
                                         std::vector<int32_t>(static_cast<std::size_t>(model.fields->particles())), 3));
  EXPECT_EQ(factored(model).stress().rows(), model.clusters.count);
  EXPECT_LT(displacement_error<double>(model, 31, {}), 0.1);
  EXPECT_THROW(model.take_clusters({}), ConfigError);
}

/// Root mean square error of the trunk of some particles at the others, and that of their nearest neighbours'
/// displacement, in dx; over the last states of the training runs.
std::pair<double, double> left_out_error(const rom::ReducedModel& model, int64_t every, double spacing, double dx) {
  rom::MlsParticles known;
  rom::ReferencePoints points;
  std::vector<int32_t> all, left_out;
  for (int32_t p = 0; p < static_cast<int32_t>(model.fields->particles()); ++p) {
    const auto x = static_cast<std::size_t>(3 * p);
    const Vec3f reference{model.reference[x], model.reference[x + 1], model.reference[x + 2]};
    all.push_back(p);
    const bool out =
        Random(4, RandomPurpose::test).integer(static_cast<uint64_t>(p), 0, static_cast<uint32_t>(every)) == 0;
    if (out) {
      left_out.push_back(p);
      points.position.push_back(reference);
      points.kind.push_back(0);
    } else {
      known.numbers.push_back(p);
      known.reference.push_back(reference);
      known.kind.push_back(0);
    }
  }
  known.spacing = spacing;
  std::vector<std::size_t> nearest;
  for (const Vec3f& x : points.position) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < known.reference.size(); ++i)
      if (norm2(known.reference[i] - x) < norm2(known.reference[best] - x)) best = i;
    nearest.push_back(best);
  }
  rom::MlsPositions<double> trunk(*model.fields, known, points);
  const auto exact = model.fields->bind_positions_f64(all);
  std::vector<double> truth(static_cast<std::size_t>(3 * mpm::padded_to_tile(model.fields->particles()))),
      x(static_cast<std::size_t>(3 * mpm::padded_to_tile(static_cast<int64_t>(left_out.size()))));
  double error2 = 0, nearest2 = 0, count = 0;
  const auto r = static_cast<std::size_t>(model.latents());
  for (std::size_t snapshot = 25; snapshot < model.training_latents.size() / r; snapshot += 26) {
    const auto first = model.training_latents.begin() + static_cast<std::ptrdiff_t>(snapshot * r);
    const rom::LatentState state{{first, first + static_cast<std::ptrdiff_t>(r)}, std::vector<double>(r), {}, 0, {}};
    trunk.decode(state, x.data());
    exact->decode(state, truth.data());
    const mpm::TiledView<double, 3> at{truth.data()}, by_trunk{x.data()};
    for (std::size_t i = 0; i < left_out.size(); ++i) {
      const Vec3d own = at.vec(left_out[i]);
      const Vec3d moved = at.vec(known.numbers[nearest[i]]) - known.reference[nearest[i]].cast<double>();
      error2 += norm2(by_trunk.vec(static_cast<int64_t>(i)) - own);
      nearest2 += norm2(points.position[i].cast<double>() + moved - own);
      count += 1;
    }
  }
  return {std::sqrt(error2 / count) / dx, std::sqrt(nearest2 / count) / dx};
}

TEST_F(NsfTraining, TheTrunkFollowsParticlesThatItDoesNotKnow) {
  NsfReport report;
  const rom::ReducedModel model = train_factored(options(), report);
  const double dx = 0.02, spacing = dx / std::cbrt(static_cast<double>(column(30).sources[0].particles_per_cell));
  for (const int64_t every : {10, 2}) {
    const auto [trunk, nearest] = left_out_error(model, every, spacing * (every == 2 ? 1.3 : 1), dx);
    RecordProperty("left_out_" + std::to_string(every), std::to_string(trunk));
    EXPECT_LT(trunk, 0.15) << "one of " << every << " left out";
    EXPECT_LT(trunk, 0.7 * nearest);
  }
}

TEST_F(NsfTraining, RefusesWhatIsNoSweep) {
  EXPECT_THROW(SnapshotSet("no_such_file.h5", nsf_fields), InputError);
  const Trajectory run = run_of(column(30));
  const std::string bare = folder_ + "/bare.h5";
  io::TrajectoryWriter writer(bare, run);
  for (const ParticleFrame& frame : run.frames) writer.append(frame);
  writer.finish();
  try {
    SnapshotSet set(bare, nsf_fields);
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
