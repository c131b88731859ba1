// States between the runs of a sweep (train/run_interpolation.h): laws of the rows that a fit gets, and what is
// refused.
#include "train/run_interpolation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "core/error.h"
#include "rom/reduced_solver.h"
#include "tests/train/curves.h"
#include "tests/train/tiny_sweep.h"
#include "train/map_fit.h"
#include "train/network_fit.h"
#include "train/nsf_training.h"

namespace graupel::train {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int snapshots = 5;

/// Linear in the parameter at each time; the last column is the parameter.
Eigen::RowVector3d state(int time, double value) {
  return {std::sin(time) + value * std::cos(3 * time), 2 - value * time * time, value};
}

MatrixXd rows_of_runs(const std::vector<double>& values, std::vector<int>& run) {
  MatrixXd rows(static_cast<Index>(values.size()) * snapshots, 3);
  for (std::size_t i = 0; i < values.size(); ++i)
    for (int t = 0; t < snapshots; ++t) {
      rows.row(static_cast<Index>(i) * snapshots + t) = state(t, values[i]);
      run.push_back(static_cast<int>(i));
    }
  return rows;
}

TEST(RunInterpolation, IsExactForRunsThatAreLinearInTheParameter) {
  const std::vector<double> values = {-12, -20, -16};  // in any order
  std::vector<int> run;
  const MatrixXd rows = rows_of_runs(values, run);
  const MatrixXd extended = RunInterpolation(values, 3).extend(rows, run);
  ASSERT_EQ(extended.rows(), (3 + 2 * 3) * snapshots);
  EXPECT_EQ(extended.topRows(rows.rows()), rows);
  for (int i = 0; i < 6; ++i) {
    const double value = -20 + (i < 3 ? i + 1 : i + 2);  // -19 to -17, -15 to -13
    for (int t = 0; t < snapshots; ++t)
      EXPECT_LT((extended.row(rows.rows() + i * snapshots + t) - state(t, value)).cwiseAbs().maxCoeff(), 1e-12 * 400)
          << value;
  }
}

TEST(RunInterpolation, LeavesOutWhatIsHeldOut) {
  const std::vector<double> values = {1, 2, 3, 4};
  std::vector<int> run;
  const MatrixXd rows = rows_of_runs(values, run);
  std::vector<Index> kept;
  std::vector<int> kept_run;
  for (std::size_t i = 0; i < run.size(); ++i)
    if (run[i] != 1) {
      kept.push_back(static_cast<Index>(i));
      kept_run.push_back(run[i]);
    }
  const MatrixXd extended = RunInterpolation(values, 1).extend(rows(kept, Eigen::all), kept_run);
  ASSERT_EQ(extended.rows(), 5 * snapshots);
  EXPECT_DOUBLE_EQ(extended(3 * snapshots, 2), 2);  // between 1 and 3, from these alone
  EXPECT_DOUBLE_EQ(extended(4 * snapshots, 2), 3.5);
  const MatrixXd single = rows.topRows(snapshots);
  EXPECT_EQ(RunInterpolation(values, 4).extend(single, std::vector<int>(snapshots, 0)), single);
  EXPECT_EQ(RunInterpolation().extend(rows, run), rows);
}

/// Largest error of a map of Curves(9, 25) at the runs that a fit of every other one did not have.
double error_between(const std::function<void(const double*, double*)>& evaluate) {
  const Curves all(9, 25, false);
  double worst = 0;
  for (Index i = 0; i < all.inputs.rows(); ++i) {
    if (all.run[static_cast<std::size_t>(i)] % 4 == 0) continue;
    const Eigen::Vector3d z = all.inputs.row(i);
    double c[2];
    evaluate(z.data(), c);
    for (int k = 0; k < 2; ++k) worst = std::max(worst, std::abs(c[k] - all.outputs(i, k)));
  }
  return worst;
}

TEST(RunInterpolation, FitsFollowTheStatesBetweenTheRuns) {
  const Curves all(9, 25, false);
  std::vector<Index> rows;
  std::vector<int> run;
  for (std::size_t i = 0; i < all.run.size(); ++i)
    if (all.run[i] % 4 == 0) {
      rows.push_back(static_cast<Index>(i));
      run.push_back(all.run[i] / 4);
    }
  const MatrixXd inputs = all.inputs(rows, Eigen::all), outputs = all.outputs(rows, Eigen::all);
  const RunInterpolation between({0, 4, 8}, 3);
  for (const int centers : {60, 1000}) {
    const MapFit without = fit_map(inputs, outputs, run, centers),
                 with = fit_map(inputs, outputs, run, centers, between);
    const auto error = [](const MapFit& fit) {
      return error_between([&](const double* z, double* c) { fit.map.evaluate(z, c); });
    };
    EXPECT_LT(error(with), 0.8 * error(without)) << centers;
    EXPECT_LT(error(with), 0.03) << centers;
  }
  NetworkFitOptions options;
  options.width = 16;
  options.steps = 1000;
  options.between = between;
  const NetworkFit network = fit_network(inputs, outputs, run, options);
  EXPECT_LT(error_between([&](const double* z, double* c) { network.map.evaluate(z, c); }), 0.1);
}

/// A sweep file of runs with these parameters and frames.
class RunInterpolationRefusals : public testing::Test {
 protected:
  struct Run {
    std::vector<io::NamedValue> parameters;
    int frames;
  };

  static std::string refusal(const std::vector<Run>& runs) {
    const std::string folder = std::string(GRAUPEL_BINARY_DIR) + "/run_interpolation_test_data";
    remove_path(folder);
    make_folder(folder);
    static const Trajectory truth = [] {
      Scene scene = column(30);
      scene.frames = 2;
      return run_of(scene);
    }();
    std::vector<std::string> parts;
    for (const Run& run : runs) {
      parts.push_back(folder + "/part" + std::to_string(parts.size()) + ".h5");
      io::TrajectoryWriteOptions options;
      options.fields = {ParticleField::stress, ParticleField::affine};
      io::TrajectoryWriter writer(parts.back(), truth, options);
      writer.parameters(run.parameters);
      for (int f = 0; f < run.frames; ++f) writer.append(truth.frames[static_cast<std::size_t>(f)]);
      writer.finish();
    }
    io::merge_trajectories(parts, folder + "/train.h5");
    try {
      RunInterpolation::of(SnapshotSet(folder + "/train.h5"), 2);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  }

  static io::NamedValue angle(double value) {
    return {"friction_angle", "degrees", value, {"materials.sand.friction_angle"}};
  }
  static io::NamedValue stiffness(double value) {
    return {"stiffness", "Pa", value, {"materials.sand.youngs_modulus"}};
  }
};

TEST_F(RunInterpolationRefusals, SeveralParameters) {
  const std::string what = refusal({{{angle(20), stiffness(1)}, 3}, {{angle(30), stiffness(2)}, 3}});
  EXPECT_NE(what.find("between_runs is 2, but the sweep has 2 parameters (needed: one). Set it to 0"),
            std::string::npos)
      << what;
}

TEST_F(RunInterpolationRefusals, RunsOfDifferentLengths) {
  const std::string what = refusal({{{angle(20)}, 3}, {{angle(30)}, 2}});
  EXPECT_NE(what.find("run 1 has 2 snapshots, run 0 3"), std::string::npos) << what;
}

TEST_F(RunInterpolationRefusals, RunsOfOneValue) {
  const std::string what = refusal({{{angle(20)}, 3}, {{angle(20)}, 3}});
  EXPECT_NE(what.find("two runs have the same friction_angle (20)"), std::string::npos) << what;
  EXPECT_EQ(refusal({{{angle(20)}, 3}, {{angle(30)}, 3}}), "");
}

}  // namespace
}  // namespace graupel::train
