#include "train/reduced/pod.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/parallel/parallel_for.h"

namespace graupel::train {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::MatrixXf;

constexpr Index pieces_at_once = 8;

/// gram += sum of part part^T over the pieces of a block, lower triangle. Pieces are multiplied in f32 by several
/// threads and added in f64 in their order.
void add_products(const SnapshotMatrix& block, const Eigen::RowVectorXf& mean, MatrixXd& gram) {
  const Index n = block.rows(), pieces = (block.cols() + SnapshotBlocks::piece - 1) / SnapshotBlocks::piece;
  std::vector<MatrixXf> products(static_cast<std::size_t>(std::min(pieces, pieces_at_once)), MatrixXf::Zero(n, n));
  for (Index begin = 0; begin < pieces; begin += pieces_at_once) {
    const Index count = std::min(pieces_at_once, pieces - begin);
    const auto multiply = [&](int64_t i) {
      const Index first = (begin + i) * SnapshotBlocks::piece,
                  width = std::min(SnapshotBlocks::piece, block.cols() - first);
      const MatrixXf part = block.middleCols(first, width).rowwise() - mean.segment(first, width);
      products[static_cast<std::size_t>(i)].triangularView<Eigen::Lower>() = part * part.transpose();
    };
    parallel_for_cpu(count, multiply, Grain{1});
    for (Index i = 0; i < count; ++i) gram += products[static_cast<std::size_t>(i)].cast<double>();
  }
}

Eigen::RowVectorXf mean_of(const SnapshotMatrix& block, PodMean about) {
  if (about == PodMean::kept) return Eigen::RowVectorXf::Zero(block.cols());
  return (block.cast<double>().colwise().sum() / static_cast<double>(block.rows())).cast<float>();
}

}  // namespace

double Pod::tail(int count) const {
  const Eigen::Index kept = std::min<Eigen::Index>(count, singular.size());
  const double all = singular.squaredNorm();
  return all > 0 ? std::sqrt(singular.tail(singular.size() - kept).squaredNorm() / all) : 0;
}

Pod pod(SnapshotBlocks& snapshots, int modes, PodMean about) {
  const Index n = snapshots.snapshots();
  Pod result;
  result.mean.resize(static_cast<std::size_t>(snapshots.width()));
  MatrixXd gram = MatrixXd::Zero(n, n);
  for (int b = 0; b < snapshots.blocks(); ++b) {
    const SnapshotMatrix block = snapshots.load(b);
    const Eigen::RowVectorXf mean = mean_of(block, about);
    std::copy_n(mean.data(), mean.size(), result.mean.begin() + snapshots.first_column(b));
    add_products(block, mean, gram);
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(gram);  // reads the lower triangle
  const Eigen::VectorXd values = solver.eigenvalues().reverse().cwiseMax(0.0);
  result.singular = values.cwiseSqrt();
  // Below this a mode is the rounding of the f32 products.
  const double least = 1e-6 * result.singular[0];
  Index kept = 0;
  while (kept < std::min<Index>(modes, n) && result.singular[kept] > least) ++kept;
  const MatrixXd vectors = solver.eigenvectors().rowwise().reverse().leftCols(kept);
  result.coefficients = std::sqrt(static_cast<double>(n)) * vectors;
  // mode_k = sum_i (snapshot_i - mean) v_ik / sqrt(n), so that snapshot = mean + sum_k coefficient_k mode_k.
  const MatrixXf weights = (vectors / std::sqrt(static_cast<double>(n))).cast<float>();
  result.basis.resize(static_cast<std::size_t>(snapshots.width() * kept));
  Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> basis(result.basis.data(),
                                                                                          snapshots.width(), kept);
  const Eigen::Map<const Eigen::RowVectorXf> mean(result.mean.data(), snapshots.width());
  for (int b = snapshots.blocks() - 1; b >= 0; --b) {
    const SnapshotMatrix block = snapshots.load(b);
    const Index offset = snapshots.first_column(b);
    for (Index first = 0; first < block.cols(); first += SnapshotBlocks::piece) {
      const Index count = std::min(SnapshotBlocks::piece, block.cols() - first);
      const MatrixXf part = block.middleCols(first, count).rowwise() - mean.segment(offset + first, count);
      basis.middleRows(offset + first, count).noalias() = part.transpose() * weights;
    }
  }
  return result;
}

MatrixXd project(SnapshotBlocks& rows, const Pod& pod, int modes) {
  const SnapshotMatrix basis(pod.basis.data(), rows.width(), pod.modes());
  MatrixXd product = MatrixXd::Zero(rows.snapshots(), modes), gram = MatrixXd::Zero(modes, modes);
  for (int b = 0; b < rows.blocks(); ++b) {
    const SnapshotMatrix block = rows.load(b);
    for (Index first = 0; first < block.cols(); first += SnapshotBlocks::piece) {
      const Index count = std::min(SnapshotBlocks::piece, block.cols() - first);
      const auto part = basis.block(rows.first_column(b) + first, 0, count, modes);
      product += (block.middleCols(first, count) * part).cast<double>();
      gram += (part.transpose() * part).cast<double>();
    }
  }
  return gram.ldlt().solve(product.transpose()).transpose();
}

}  // namespace graupel::train
