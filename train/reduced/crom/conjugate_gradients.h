// Conjugate gradients for many right-hand sides of one sparse matrix, which is read once an iteration for all of them.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace graupel::train {

using RowSparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct IterativeSolution {
  RowMatrix values;  ///< X [n, columns]
  int iterations = 0;
  double residual = 0;  ///< largest |B - A X| / |B| of a column
};

/// A X = B for a symmetric positive definite A, from X = 0, with the diagonal as the preconditioner, until no column's
/// residual is above `tolerance`, or after `most` iterations.
IterativeSolution solve_by_conjugate_gradients(const RowSparse& matrix, const RowMatrix& right, double tolerance,
                                               int most);

}  // namespace graupel::train
