#include "train/reduced/crom/mode_fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "train/reduced/crom/conjugate_gradients.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::MatrixXd;
using rom::ModeLattice;
using rom::ModeStencil;

namespace {

constexpr int64_t most_nodes = 400'000;  // their equations take some 2 GB
constexpr double smoothness = 1e-4;      // of the mean diagonal, for second differences of nodes

/// (D^T D)^-1 D^T with D = latents - rest: what makes coefficients of the modes from snapshots.
MatrixXd regression(const MatrixXd& latents, const std::vector<double>& rest) {
  const MatrixXd from_rest =
      latents.rowwise() - Eigen::Map<const Eigen::RowVectorXd>(rest.data(), static_cast<Index>(rest.size()));
  MatrixXd normal = from_rest.transpose() * from_rest;
  normal.diagonal().array() += 1e-12 * normal.trace();
  return normal.llt().solve(from_rest.transpose());
}

/// Slopes of a field along the latents, less `base` in each snapshot, [r, particles * components].
RowMatrix slopes_of(const SweepSnapshots& snapshots, SnapshotField field, const MatrixXd& regress,
                    const Eigen::RowVectorXd& base) {
  FieldBlocks blocks = snapshots.blocks(field, nullptr);
  RowMatrix slopes(regress.rows(), blocks.width());
  for (int b = 0; b < blocks.blocks(); ++b) {
    const SnapshotMatrix block = blocks.load(b);
    constexpr Index width = 4096;  // columns at once, so that few of them are there in f64
    const auto some_columns = [&](int64_t part) {
      const Index first = part * width, count = std::min(width, block.cols() - first);
      slopes.middleCols(blocks.first_column(b) + first, count).noalias() =
          regress * block.middleCols(first, count).cast<double>();
    };
    parallel_for_cpu((block.cols() + width - 1) / width, some_columns, Grain{1});
  }
  slopes.noalias() -= regress.rowwise().sum() * base;
  return slopes;
}

/// The normal equations of the nodes, the same for every mode and axis; a node meets those up to two away along each
/// axis.
class LatticeEquations {
 public:
  explicit LatticeEquations(const ModeLattice& lattice)
      : lattice_(lattice), rows_(static_cast<std::size_t>(lattice.nodes() * across * across * across)) {}

  void add(int64_t row, int64_t column, double value) {
    const auto r = indices(row), c = indices(column);
    rows_[static_cast<std::size_t>(row * across * across * across +
                                   ((c[0] - r[0] + 2) * across + (c[1] - r[1] + 2)) * across + (c[2] - r[2] + 2))] +=
        value;
  }
  /// Squares of second differences along each axis, so that nodes beside the body go on smoothly: those that no
  /// particle depends on but a neighbour's. Nodes further away stay 0. After all else was added.
  void add_smoothness(double share_of_mean_diagonal) {
    find_nodes_in_use();
    const double weight = share_of_mean_diagonal * mean_diagonal();
    constexpr double difference[3] = {1, -2, 1};
    for (int axis = 0; axis < 3; ++axis)
      for (int64_t n = 0; n < lattice_.nodes(); ++n) {
        Vec<int, 3> at = indices(n);
        if (at[axis] + 2 >= lattice_.count[axis]) continue;
        int64_t node[3];
        bool all_used = true;
        for (int64_t& along : node) {
          along = lattice_.node(at[0], at[1], at[2]);
          all_used = all_used && used_[static_cast<std::size_t>(along)];
          ++at[axis];
        }
        if (!all_used) continue;
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) add(node[i], node[j], weight * difference[i] * difference[j]);
      }
    for (int64_t n = 0; n < lattice_.nodes(); ++n)
      if (!used_[static_cast<std::size_t>(n)]) add(n, n, 1);
  }
  RowSparse matrix() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (int64_t n = 0; n < lattice_.nodes(); ++n) {
      const Vec<int, 3> at = indices(n);
      for (int i = -2, e = 0; i <= 2; ++i)
        for (int j = -2; j <= 2; ++j)
          for (int k = -2; k <= 2; ++k, ++e) {
            const double value = rows_[static_cast<std::size_t>(n * 125 + e)];
            if (value != 0)
              entries.emplace_back(static_cast<int>(n),
                                   static_cast<int>(lattice_.node(at[0] + i, at[1] + j, at[2] + k)), value);
          }
    }
    RowSparse all(static_cast<Index>(lattice_.nodes()), static_cast<Index>(lattice_.nodes()));
    all.setFromTriplets(entries.begin(), entries.end());
    return all;
  }

 private:
  static constexpr int64_t across = 5;

  double diagonal(int64_t node) const { return rows_[static_cast<std::size_t>(node * 125 + 62)]; }
  double mean_diagonal() const {
    double sum = 0;
    for (int64_t n = 0; n < lattice_.nodes(); ++n) sum += diagonal(n);
    return sum / static_cast<double>(std::count(used_.begin(), used_.end(), true));
  }
  void find_nodes_in_use() {
    used_.assign(static_cast<std::size_t>(lattice_.nodes()), false);
    for (int64_t n = 0; n < lattice_.nodes(); ++n) {
      if (!(diagonal(n) > 0)) continue;
      const Vec<int, 3> at = indices(n);
      for (int i = std::max(0, at[0] - 1); i <= std::min(lattice_.count[0] - 1, at[0] + 1); ++i)
        for (int j = std::max(0, at[1] - 1); j <= std::min(lattice_.count[1] - 1, at[1] + 1); ++j)
          for (int k = std::max(0, at[2] - 1); k <= std::min(lattice_.count[2] - 1, at[2] + 1); ++k)
            used_[static_cast<std::size_t>(lattice_.node(i, j, k))] = true;
    }
  }

  Vec<int, 3> indices(int64_t node) const {
    const int64_t plane = static_cast<int64_t>(lattice_.count[1]) * lattice_.count[2];
    return {static_cast<int>(node / plane), static_cast<int>(node % plane / lattice_.count[2]),
            static_cast<int>(node % lattice_.count[2])};
  }

  const ModeLattice& lattice_;
  std::vector<double> rows_;  ///< [nodes, 5, 5, 5]
  std::vector<bool> used_;    ///< [nodes]
};

void refuse_large(const ModeLattice& lattice) {
  if (lattice.nodes() <= most_nodes) return;
  throw ConfigError(fmt::format("a lattice of {} nodes is too large for modes (allowed: {}). Raise mode_spacing",
                                lattice.nodes(), most_nodes));
}

}  // namespace

rom::ModeDeformation fit_modes(const SweepSnapshots& snapshots, const MatrixXd& latents,
                               const std::vector<double>& rest, const ModeFit& fit) {
  std::vector<float> points;
  for (const Vec3f& x : snapshots.set().reference()) points.insert(points.end(), x.a, x.a + 3);
  const ModeLattice lattice = ModeLattice::around(points, fit.spacing, fit.origin);
  refuse_large(lattice);
  const auto particles = static_cast<Index>(points.size() / 3);
  Eigen::RowVectorXd identity = Eigen::RowVectorXd::Zero(9 * particles);
  for (Index p = 0; p < particles; ++p)
    for (Index d = 0; d < 3; ++d) identity[9 * p + 4 * d] = 1;
  const MatrixXd regress = regression(latents, rest);
  const RowMatrix displacement =
      slopes_of(snapshots, SnapshotField::position, regress,
                Eigen::Map<const Eigen::RowVectorXf>(points.data(), 3 * particles).cast<double>());
  const RowMatrix gradient = slopes_of(snapshots, SnapshotField::deformation_gradient, regress, identity);

  const Index r = regress.rows();
  LatticeEquations equations(lattice);
  RowMatrix right = RowMatrix::Zero(static_cast<Index>(lattice.nodes()), 3 * r);
  for (Index p = 0; p < particles; ++p) {
    const auto i = static_cast<std::size_t>(3 * p);
    const ModeStencil at(lattice, {static_cast<double>(points[i]), static_cast<double>(points[i + 1]),
                                   static_cast<double>(points[i + 2])});
    for (int n = 0; n < rom::mode_stencil; ++n) {
      for (int m = 0; m < rom::mode_stencil; ++m)
        equations.add(at.node[n], at.node[m],
                      at.weight[n] * at.weight[m] + fit.gradient_weight * dot(at.gradient[n], at.gradient[m]));
      for (Index k = 0; k < r; ++k)
        for (Index c = 0; c < 3; ++c) {
          double target = at.weight[n] * displacement(k, 3 * p + c);
          for (Index d = 0; d < 3; ++d)
            target += fit.gradient_weight * at.gradient[n][static_cast<int>(d)] * gradient(k, 9 * p + 3 * c + d);
          right(static_cast<Index>(at.node[n]), 3 * k + c) += target;
        }
    }
  }
  equations.add_smoothness(smoothness);
  constexpr double tolerance = 1e-5;
  constexpr int most_iterations = 2000;
  const IterativeSolution solution =
      solve_by_conjugate_gradients(equations.matrix(), right, tolerance, most_iterations);
  const RowMatrix& nodes = solution.values;
  if (!nodes.allFinite()) throw ConfigError("the modes' equations have no solution. Raise mode_spacing");
  std::vector<float> values;
  values.reserve(static_cast<std::size_t>(nodes.size()));
  for (Index k = 0; k < r; ++k)
    for (Index n = 0; n < nodes.rows(); ++n)
      for (Index c = 0; c < 3; ++c) values.push_back(static_cast<float>(nodes(n, 3 * k + c)));
  return {lattice, std::move(values), rest};
}

}  // namespace graupel::train
