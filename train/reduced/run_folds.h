// What the fits of branches share: which runs are held out to judge a fit by, and the standardised inputs with their
// linear part. Snapshots of one run lie close together, so holding out single ones would tell nothing.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "rom/networks/standardization.h"

namespace graupel::train {

/// Rows that are fitted, and those of the run that is held out.
struct Fold {
  std::vector<Eigen::Index> fitted, held_out;
};
/// Four folds at most, one run held out in each, none of them the first or the last: a new parameter lies between those
/// of the training. `run`: of every row.
std::vector<Fold> folds_of(const std::vector<int>& run);

/// Mean 0 and mean square 1 for every column; a constant one keeps its scale.
rom::Standardization column_standardization(const Eigen::MatrixXd& inputs);
Eigen::MatrixXd standardized(const Eigen::MatrixXd& inputs, const rom::Standardization& by);
/// (1, y).
Eigen::MatrixXd with_ones(const Eigen::MatrixXd& y);

std::vector<double> row_major(const Eigen::MatrixXd& m);

}  // namespace graupel::train
