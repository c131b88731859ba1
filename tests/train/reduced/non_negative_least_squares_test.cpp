// Non-negative least squares: known answers, the conditions of Karush, Kuhn and Tucker, and what is refused.
#include "train/reduced/non_negative_least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::train {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr NonNegativeOptions exact{.sweeps = 100000, .gain = 0};

VectorXd solve(const MatrixXd& a, const VectorXd& b, NonNegativeOptions options = exact) {
  return non_negative_least_squares(a.sparseView(), b, VectorXd::Ones(a.cols()), options);
}

MatrixXd random_matrix(Index rows, Index columns, int stream) {
  const Random random(17, RandomPurpose::test);
  MatrixXd a(rows, columns);
  for (Index i = 0; i < a.size(); ++i) a.data()[i] = random.uniform(static_cast<uint64_t>(i), stream, -1, 1);
  return a;
}

TEST(NonNegativeLeastSquares, OfTheIdentityCutsWhatIsNegative) {
  EXPECT_LT((solve(MatrixXd::Identity(3, 3), Eigen::Vector3d(2, -3, 0.5)) - Eigen::Vector3d(2, 0, 0.5)).norm(), 1e-14);
}

TEST(NonNegativeLeastSquares, OfAFallingLineIsItsMean) {
  MatrixXd a(3, 2);  // intercept and slope; without the bound 4 and -1
  a << 1, 1, 1, 2, 1, 3;
  EXPECT_LT((solve(a, Eigen::Vector3d(3, 2, 1)) - Eigen::Vector2d(2, 0)).norm(), 1e-9);
}

TEST(NonNegativeLeastSquares, FindsWeightsThatRepresentTheValues) {
  const MatrixXd a = random_matrix(60, 20, 0);
  VectorXd weights = random_matrix(20, 1, 1).cwiseAbs();
  for (Index c = 0; c < 20; c += 3) weights[c] = 0;
  EXPECT_LT((solve(a, a * weights) - weights).norm(), 1e-6);
}

TEST(NonNegativeLeastSquares, ObeysTheConditionsOfOptimality) {
  const MatrixXd a = random_matrix(40, 15, 2);
  const VectorXd b = random_matrix(40, 1, 3), w = solve(a, b), gradient = a.transpose() * (a * w - b);
  int zeros = 0;
  for (Index c = 0; c < 15; ++c) {
    EXPECT_GE(w[c], 0);
    EXPECT_GT(gradient[c], -1e-6);
    if (w[c] > 0)
      EXPECT_NEAR(gradient[c], 0, 1e-6);
    else
      ++zeros;
  }
  EXPECT_GT(zeros, 0);
  EXPECT_LT(zeros, 15);
}

TEST(NonNegativeLeastSquares, ThePullDecidesWhereRowsDoNot) {
  MatrixXd a = MatrixXd::Zero(1, 3);
  a(0, 0) = a(0, 1) = 1;
  NonNegativeOptions pulled = exact;
  pulled.pull = 0.1;  // 2 (2 w - 4) + 0.2 (w - 1) = 0
  const VectorXd w = solve(a, VectorXd::Constant(1, 4), pulled);
  EXPECT_NEAR(w[0], 8.2 / 4.2, 1e-7);
  EXPECT_NEAR(w[1], 8.2 / 4.2, 1e-7);
  EXPECT_EQ(w[2], 1);  // no row has it
}

TEST(NonNegativeLeastSquares, RefusesWhatDoesNotFit) {
  const MatrixXd a = MatrixXd::Identity(3, 2);
  EXPECT_THROW(solve(a, VectorXd::Ones(2)), ConfigError);
  EXPECT_THROW(solve(a, VectorXd::Constant(3, std::nan(""))), ConfigError);
  EXPECT_THROW(non_negative_least_squares(a.sparseView(), VectorXd::Ones(3), VectorXd::Constant(2, -1)), ConfigError);
}

}  // namespace
}  // namespace graupel::train
