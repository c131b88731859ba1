#include "train/pod.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace graupel::train {

namespace {

constexpr Eigen::Index block = 4096;  ///< columns that are multiplied in f32 before they are added in f64

}  // namespace

double Pod::tail(int count) const {
  const Eigen::Index kept = std::min<Eigen::Index>(count, singular.size());
  const double all = singular.squaredNorm();
  return all > 0 ? std::sqrt(singular.tail(singular.size() - kept).squaredNorm() / all) : 0;
}

Pod pod(const SnapshotMatrix& snapshots, int modes, PodMean about) {
  const Eigen::Index n = snapshots.rows(), width = snapshots.cols();
  Pod result;
  Eigen::RowVectorXf mean = Eigen::RowVectorXf::Zero(width);
  if (about == PodMean::removed)
    mean = (snapshots.cast<double>().colwise().sum() / static_cast<double>(n)).cast<float>();
  result.mean.assign(mean.data(), mean.data() + width);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index first = 0; first < width; first += block) {
    const Eigen::Index count = std::min(block, width - first);
    const Eigen::MatrixXf part = snapshots.middleCols(first, count).rowwise() - mean.segment(first, count);
    gram += (part * part.transpose()).cast<double>();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  const Eigen::VectorXd values = solver.eigenvalues().reverse().cwiseMax(0.0);
  result.singular = values.cwiseSqrt();
  // Below this a mode is the rounding of the f32 products.
  const double least = 1e-6 * result.singular[0];
  Eigen::Index kept = 0;
  while (kept < std::min<Eigen::Index>(modes, n) && result.singular[kept] > least) ++kept;
  const Eigen::MatrixXd vectors = solver.eigenvectors().rowwise().reverse().leftCols(kept);
  result.coefficients = std::sqrt(static_cast<double>(n)) * vectors;
  // mode_k = sum_i (snapshot_i - mean) v_ik / sqrt(n), so that snapshot = mean + sum_k coefficient_k mode_k.
  const Eigen::MatrixXf weights = (vectors / std::sqrt(static_cast<double>(n))).cast<float>();
  result.basis.resize(static_cast<std::size_t>(width * kept));
  Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> basis(result.basis.data(), width,
                                                                                          kept);
  for (Eigen::Index first = 0; first < width; first += block) {
    const Eigen::Index count = std::min(block, width - first);
    const Eigen::MatrixXf part = snapshots.middleCols(first, count).rowwise() - mean.segment(first, count);
    basis.middleRows(first, count).noalias() = part.transpose() * weights;
  }
  return result;
}

Eigen::MatrixXd project(const SnapshotMatrix& rows, const Pod& pod, int modes) {
  const SnapshotMatrix basis(pod.basis.data(), rows.cols(), pod.modes());
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(rows.rows(), modes), gram = Eigen::MatrixXd::Zero(modes, modes);
  for (Eigen::Index first = 0; first < rows.cols(); first += block) {
    const Eigen::Index count = std::min(block, rows.cols() - first);
    const auto part = basis.block(first, 0, count, modes);
    product += (rows.middleCols(first, count) * part).cast<double>();
    gram += (part.transpose() * part).cast<double>();
  }
  return gram.ldlt().solve(product.transpose()).transpose();
}

}  // namespace graupel::train
