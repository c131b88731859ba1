#include "train/reduced/crom/conjugate_gradients.h"

#include <algorithm>

#include "core/parallel/parallel_for.h"

namespace graupel::train {

using Eigen::Index;

namespace {

RowMatrix product(const RowSparse& matrix, const RowMatrix& x) {
  RowMatrix result(x.rows(), x.cols());
  const auto row = [&](int64_t i) {
    auto sum = result.row(i);
    sum.setZero();
    for (RowSparse::InnerIterator entry(matrix, i); entry; ++entry) sum += entry.value() * x.row(entry.col());
  };
  parallel_for_cpu(matrix.rows(), row, Grain{1024});
  return result;
}

/// Dot product of every column; 1 in place of 0, so that finished columns stay.
Eigen::RowVectorXd column_dots(const RowMatrix& a, const RowMatrix& b) {
  const Eigen::RowVectorXd dots = a.cwiseProduct(b).colwise().sum();
  return (dots.array() == 0).select(1.0, dots);
}

}  // namespace

IterativeSolution solve_by_conjugate_gradients(const RowSparse& matrix, const RowMatrix& right, double tolerance,
                                               int most) {
  const Eigen::VectorXd inverse_diagonal = matrix.diagonal().cwiseInverse();
  const Eigen::RowVectorXd size = column_dots(right, right).cwiseSqrt();
  IterativeSolution solution;
  solution.values = RowMatrix::Zero(right.rows(), right.cols());
  RowMatrix residual = right, scaled = inverse_diagonal.asDiagonal() * residual, direction = scaled;
  Eigen::RowVectorXd slope = column_dots(residual, scaled);
  for (;; ++solution.iterations) {
    solution.residual = (residual.colwise().norm().array() / size.array()).maxCoeff();
    if (!(solution.residual > tolerance) || solution.iterations == most) return solution;
    const RowMatrix image = product(matrix, direction);
    const Eigen::RowVectorXd step = slope.cwiseQuotient(column_dots(direction, image));
    solution.values += direction * step.asDiagonal();
    residual -= image * step.asDiagonal();
    scaled = inverse_diagonal.asDiagonal() * residual;
    const Eigen::RowVectorXd next = column_dots(residual, scaled);
    direction = scaled + direction * next.cwiseQuotient(slope).asDiagonal();
    slope = next;
  }
}

}  // namespace graupel::train
