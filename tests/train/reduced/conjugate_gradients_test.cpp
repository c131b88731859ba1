// Conjugate gradients against a dense solution.
#include "train/reduced/crom/conjugate_gradients.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

namespace graupel::train {
namespace {

/// Symmetric and positive definite, with rows of very different sizes.
RowSparse some_matrix(int n) {
  RowSparse matrix(n, n);
  for (int i = 0; i < n; ++i) {
    matrix.insert(i, i) = std::pow(10.0, i % 4) * 3;
    for (const int j : {i - 7, i - 1, i + 1, i + 7})
      if (j >= 0 && j < n) matrix.insert(i, j) = -0.7 * std::pow(10.0, 0.5 * (i % 4 + j % 4));
  }
  matrix.makeCompressed();
  return matrix;
}

TEST(ConjugateGradients, SolveForAllRightHandSides) {
  const RowSparse matrix = some_matrix(60);
  RowMatrix right = RowMatrix::Random(60, 3);
  right.col(1).setZero();
  const RowMatrix exact = Eigen::MatrixXd(matrix).llt().solve(right);
  const IterativeSolution solution = solve_by_conjugate_gradients(matrix, right, 1e-12, 200);
  EXPECT_LE(solution.residual, 1e-12);
  EXPECT_LT((solution.values - exact).norm(), 1e-9 * exact.norm());
  EXPECT_EQ(solution.values.col(1).norm(), 0);
}

TEST(ConjugateGradients, StopWhereTheyAreTold) {
  const RowSparse matrix = some_matrix(60);
  const RowMatrix right = RowMatrix::Random(60, 2);
  EXPECT_EQ(solve_by_conjugate_gradients(matrix, right, 0, 5).iterations, 5);
  const IterativeSolution rough = solve_by_conjugate_gradients(matrix, right, 1e-2, 200),
                          fine = solve_by_conjugate_gradients(matrix, right, 1e-8, 200);
  EXPECT_LT(rough.iterations, fine.iterations);
  EXPECT_NEAR((right - matrix * fine.values).colwise().norm().cwiseQuotient(right.colwise().norm()).maxCoeff(),
              fine.residual, 1e-9);
}

}  // namespace
}  // namespace graupel::train
