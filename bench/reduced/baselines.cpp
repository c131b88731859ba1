#include "bench/reduced/baselines.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/system/error.h"

namespace graupel::bench {

namespace {

std::vector<double> parameters_of(const io::TrajectoryReader& reader, int run) {
  std::vector<double> values;
  for (const io::NamedValue& p : reader.parameters(run)) values.push_back(p.value);
  return values;
}

std::vector<Vec3f> positions(const io::TrajectoryReader& reader, int run, int64_t frame) {
  return reader.frames(run, frame, 1).front().position;
}

std::vector<Vec3d> mixed(const io::TrajectoryReader& train, const TrainingMix& mix, int64_t frame) {
  std::vector<Vec3d> result;
  for (std::size_t i = 0; i < mix.runs.size(); ++i) {
    const std::vector<Vec3f> x = positions(train, mix.runs[i], frame);
    result.resize(x.size(), Vec3d::zero());
    for (std::size_t p = 0; p < x.size(); ++p) result[p] += mix.weights[i] * x[p].cast<double>();
  }
  return result;
}

BaselineErrors errors_of(const compare::DisplacementError& error) {
  return {error.delta(), error.displacement_relative()};
}

}  // namespace

namespace {

/// mu_i - mu of all runs, every parameter over its range, [runs][parameters].
std::vector<Eigen::VectorXd> offsets_of(const std::vector<std::vector<double>>& runs,
                                        const std::vector<double>& parameters) {
  std::vector<Eigen::VectorXd> offsets(runs.size(), Eigen::VectorXd(static_cast<Eigen::Index>(parameters.size())));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    double low = runs[0][i], high = low;
    for (const auto& other : runs) {
      low = std::min(low, other[i]);
      high = std::max(high, other[i]);
    }
    for (std::size_t run = 0; run < runs.size(); ++run)
      offsets[run][static_cast<Eigen::Index>(i)] = (runs[run][i] - parameters[i]) / (high > low ? high - low : 1);
  }
  return offsets;
}

std::vector<int> by_distance(const std::vector<Eigen::VectorXd>& offsets) {
  std::vector<int> order(offsets.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return offsets[static_cast<std::size_t>(a)].squaredNorm() < offsets[static_cast<std::size_t>(b)].squaredNorm();
  });
  return order;
}

/// w of sum w_i = 1, sum w_i offset_i = 0; none where the runs span no simplex, or do not hold the origin.
std::optional<std::vector<double>> barycentric(const std::vector<Eigen::VectorXd>& offsets,
                                               const std::vector<int>& corners) {
  const auto n = static_cast<Eigen::Index>(corners.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Ones(n, n);
  for (Eigen::Index c = 0; c < n; ++c)
    matrix.col(c).tail(n - 1) = offsets[static_cast<std::size_t>(corners[static_cast<std::size_t>(c)])];
  const Eigen::FullPivLU<Eigen::MatrixXd> factor(matrix);
  if (!factor.isInvertible()) return std::nullopt;
  const Eigen::VectorXd w = factor.solve(Eigen::VectorXd::Unit(n, 0));
  if (w.minCoeff() < -1e-9) return std::nullopt;
  return std::vector<double>(w.data(), w.data() + n);
}

}  // namespace

TrainingMix nearest_run(const std::vector<std::vector<double>>& runs, const std::vector<double>& parameters) {
  return {{by_distance(offsets_of(runs, parameters)).front()}, {1.0}};
}

std::optional<TrainingMix> runs_around(const std::vector<std::vector<double>>& runs,
                                       const std::vector<double>& parameters) {
  const std::vector<Eigen::VectorXd> offsets = offsets_of(runs, parameters);
  std::vector<int> near = by_distance(offsets);
  // With one parameter the neighbours may be far beyond the nearest runs of one side.
  if (parameters.size() > 1 && near.size() > nearest_runs) near.resize(nearest_runs);
  const std::size_t corners = parameters.size() + 1;
  if (near.size() < corners) return std::nullopt;
  std::optional<TrainingMix> best;
  double least = std::numeric_limits<double>::infinity();
  std::vector<bool> chosen(near.size(), false);
  std::fill_n(chosen.begin(), corners, true);
  do {
    TrainingMix mix;
    for (std::size_t i = 0; i < near.size(); ++i)
      if (chosen[i]) mix.runs.push_back(near[i]);
    const auto weights = barycentric(offsets, mix.runs);
    if (!weights) continue;
    mix.weights = *weights;
    double spread = 0;
    for (std::size_t c = 0; c < corners; ++c)
      spread += mix.weights[c] * offsets[static_cast<std::size_t>(mix.runs[c])].squaredNorm();
    if (spread >= least) continue;
    least = spread;
    best = std::move(mix);
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
  return best;
}

Baselines baselines_of_run(const io::TrajectoryReader& train, const io::TrajectoryReader& split, int i) {
  std::vector<std::vector<double>> runs;
  std::size_t frames = split.header(i).frame_count();
  for (int run = 0; run < train.count(); ++run) {
    runs.push_back(parameters_of(train, run));
    frames = std::min(frames, train.header(run).frame_count());
  }
  const std::vector<double> own = parameters_of(split, i);
  const TrainingMix nearest = nearest_run(runs, own);
  const std::optional<TrainingMix> around = runs_around(runs, own);
  const std::vector<Vec3f> reference = positions(split, i, 0);
  if (positions(train, nearest.runs.front(), 0).size() != reference.size())
    throw InputError("the training runs have other particles than the runs beside them. Make the data set again");
  compare::DisplacementError still(reference), near(reference), linear(reference);
  for (int64_t f = 1; f < static_cast<int64_t>(frames); ++f) {
    const std::vector<Vec3f> truth = positions(split, i, f);
    still.add(truth, reference);
    near.add(truth, mixed(train, nearest, f));
    if (around) linear.add(truth, mixed(train, *around, f));
  }
  Baselines answers{errors_of(still), errors_of(near), std::nullopt};
  if (around) answers.linear = errors_of(linear);
  return answers;
}

}  // namespace graupel::bench
