#include "train/reduced/network_fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>
#include <optional>
#include <utility>

#include "core/math/random.h"
#include "core/parallel/device.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "train/parallel/blas_threads.h"
#include "train/parallel/worker_threads.h"
#include "train/reduced/mlp/mlp_batches.h"
#include "train/reduced/mlp/mlp_module.h"
#include "train/reduced/run_folds.h"

namespace graupel::train {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double linear_ridge = 1e-9;  ///< times the mean square; a constant input would make it singular

std::vector<float> floats_of(const MatrixXd& m) {
  const std::vector<double> values = row_major(m);
  return {values.begin(), values.end()};
}

/// What is fitted: outputs = M(z) rates, or without rates outputs = c(z), which is the same with one rate of 1.
struct Regression {
  rom::Standardization input;
  MatrixXd y;               ///< standardised inputs [n, d]
  MatrixXd rates, outputs;  ///< [n, r], [n, m]
  bool has_rates = false;

  Regression chosen(const std::vector<Index>& rows) const {
    return {input, y(rows, Eigen::all), rates(rows, Eigen::all), outputs(rows, Eigen::all), has_rates};
  }
  Index size() const { return outputs.cols() * rates.cols(); }  ///< outputs of the map
};

/// M(z) rates of maps whose outputs are [n, m r].
MatrixXd times_rates(const MatrixXd& maps, const MatrixXd& rates) {
  const Index r = rates.cols();
  MatrixXd product = MatrixXd::Zero(maps.rows(), maps.cols() / r);
  for (Index k = 0; k < product.cols(); ++k)
    for (Index j = 0; j < r; ++j) product.col(k) += maps.col(k * r + j).cwiseProduct(rates.col(j));
  return product;
}

/// Least squares with features (1, y) times each rate: [1 + d, m r].
MatrixXd linear_part(const Regression& data) {
  const MatrixXd shapes = with_ones(data.y);
  const Index r = data.rates.cols(), m = data.outputs.cols();
  MatrixXd features(shapes.rows(), shapes.cols() * r);
  for (Index s = 0; s < shapes.cols(); ++s)
    for (Index j = 0; j < r; ++j) features.col(s * r + j) = shapes.col(s).cwiseProduct(data.rates.col(j));
  MatrixXd normal = features.transpose() * features;
  normal.diagonal().array() += linear_ridge * normal.diagonal().mean();
  const MatrixXd solution = normal.ldlt().solve(features.transpose() * data.outputs);
  MatrixXd linear(shapes.cols(), m * r);
  for (Index s = 0; s < shapes.cols(); ++s)
    for (Index k = 0; k < m; ++k)
      for (Index j = 0; j < r; ++j) linear(s, k * r + j) = solution(s * r + j, k);
  return linear;
}

rom::MlpMap map_of(const Regression& data, const MlpShape& shape, const nn::Weights& weights,
                   std::vector<double> output_scale, const MatrixXd& linear) {
  rom::Standardization output{std::vector<double>(output_scale.size(), 0.0), std::move(output_scale)};
  return {rom::Mlp(rom::Mlp::load_layers(weights, "", shape.inputs(), shape.width, shape.outputs), data.input,
                   std::move(output)),
          row_major(linear)};
}

/// The states of a batch beside where they are, each by normal noise of its own.
class NoisyStates {
 public:
  NoisyStates(const MatrixXd& y, const NetworkFitOptions& options)
      : exact_(floats_of(y)),
        width_(static_cast<std::size_t>(y.cols())),
        noise_(options.noise),
        random_(options.seed, RandomPurpose::training_noise) {}
  const std::vector<float>& exact() const { return exact_; }

  void move(const MlpBatch& batch, MlpModule& module) {
    if (noise_ == 0) return;
    std::vector<float> states = exact_;
    for (const int64_t snapshot : batch.snapshots)
      for (std::size_t j = 0; j < width_; ++j) {
        double first, second;
        random_.normal(next_++, 0, first, second);
        states[static_cast<std::size_t>(snapshot) * width_ + j] += static_cast<float>(noise_ * first);
      }
    module.set_states(states);
  }

 private:
  std::vector<float> exact_;
  std::size_t width_;
  double noise_;
  Random random_;
  uint64_t next_ = 0;
};

/// Adam on the module's data, `snapshots` of them.
void train(MlpModule& module, NoisyStates& states, int64_t snapshots, const NetworkFitOptions& options) {
  MlpBatches batches(options.seed, 0, snapshots, 1, options.batch, 1);
  for (int64_t step = 0; step < options.steps; ++step) {
    const MlpBatch batch = batches.batch(step);
    states.move(batch, module);
    const double progress = static_cast<double>(step) / static_cast<double>(options.steps);
    module.train_step(batch, options.learning_rate * 0.5 * (1 + std::cos(std::numbers::pi * progress)), step + 1);
  }
  if (!std::isfinite(module.take_loss()))
    throw DivergedError(
        fmt::format("the training of a branch diverged (its loss is not a finite number, learning rate {:g}). Set "
                    "branch_learning_rate lower",
                    options.learning_rate));
}

rom::MlpMap fit_rows(const Regression& data, const NetworkFitOptions& options) {
  const MatrixXd linear = linear_part(data);
  const MatrixXd rest = data.outputs - times_rates(with_ones(data.y) * linear, data.rates);
  const auto mean_square = [](const MatrixXd& m) {
    return m.size() > 0 ? m.squaredNorm() / static_cast<double>(m.size()) : 0;
  };
  // One scale for all outputs: they are weighted already.
  const double size = std::max(std::sqrt(mean_square(rest)), 1e-30);
  std::vector<double> rate_size, output_scale(static_cast<std::size_t>(data.size()));
  MatrixXd rates = data.rates;
  for (Index j = 0; j < rates.cols(); ++j) {
    rate_size.push_back(std::max(std::sqrt(mean_square(rates.col(j))), 1e-30));
    rates.col(j) /= rate_size.back();
  }
  for (std::size_t i = 0; i < output_scale.size(); ++i) output_scale[i] = size / rate_size[i % rate_size.size()];
  MlpShape shape;
  shape.latents = static_cast<int>(data.y.cols());
  shape.width = options.width;
  shape.outputs = static_cast<int>(data.size());
  shape.coordinates = 0;
  shape.rates = data.has_rates ? static_cast<int>(rates.cols()) : 0;
  MlpModule module(shape, Device::cpu, options.seed);
  NoisyStates states(data.y, options);
  module.set_states(states.exact());
  if (data.has_rates) module.set_rates(floats_of(rates));
  if (data.size() > 0) {  // a closure of no modes beyond the latents has nothing to learn
    module.set_targets(floats_of(rest / size), std::numeric_limits<double>::infinity());
    train(module, states, data.y.rows(), options);
  }
  return map_of(data, shape, module.state(MlpArray::weights), std::move(output_scale), linear);
}

/// Sum of squared errors of the map at rows of the inputs.
double squared_error(const rom::MlpMap& map, const MatrixXd& inputs, const Regression& data,
                     const std::vector<Index>& rows) {
  double sum = 0;
  std::vector<double> c(static_cast<std::size_t>(data.size()));
  for (const Index row : rows) {
    const Eigen::VectorXd z = inputs.row(row);
    map.evaluate(z.data(), c.data());
    const MatrixXd maps = Eigen::Map<const Eigen::RowVectorXd>(c.data(), data.size());
    sum += (times_rates(maps, data.rates.row(row)) - data.outputs.row(row)).squaredNorm();
  }
  return sum;
}

/// The networks without a run each and the one of all rows, a thread each: single steps are too small to share.
NetworkFit fit(const MatrixXd& inputs, const Regression& data, const std::vector<int>& run,
               const NetworkFitOptions& options) {
  const std::vector<Fold> parts = folds_of(run);
  const BlasThreads one_thread(1);
  std::optional<rom::MlpMap> map;
  std::vector<double> error(parts.size());
  std::mutex speaks;
  for_each_index(num_threads(), static_cast<int64_t>(parts.size()) + 1, [&](int64_t task) {
    if (task == 0) {
      map = fit_rows(data, options);
      return;
    }
    const auto i = static_cast<std::size_t>(task - 1);
    const Fold& fold = parts[i];
    const Stopwatch watch;
    const Regression fitted = data.chosen(fold.fitted);
    error[i] = squared_error(fit_rows(fitted, options), inputs, data, fold.held_out);
    const double squares = data.outputs(fold.held_out, Eigen::all).squaredNorm();
    if (!options.message || squares == 0) return;
    const std::lock_guard lock(speaks);
    options.message(fmt::format("network without run {}: {:.3g} % in that run, {:.1f} s",
                                run[static_cast<std::size_t>(fold.held_out.front())],
                                100 * std::sqrt(error[i] / squares), watch.seconds()));
  });
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    sum += error[i];
    squares += data.outputs(parts[i].held_out, Eigen::all).squaredNorm();
  }
  return {std::move(*map), squares > 0 ? std::sqrt(sum / squares) : 0};
}

}  // namespace

NetworkFit fit_network(const MatrixXd& inputs, const MatrixXd& outputs, const std::vector<int>& run,
                       const NetworkFitOptions& options) {
  const rom::Standardization input = column_standardization(inputs);
  return fit(inputs, {input, standardized(inputs, input), MatrixXd::Ones(inputs.rows(), 1), outputs, false}, run,
             options);
}

NetworkFit fit_rate_network(const MatrixXd& inputs, const MatrixXd& rates, const MatrixXd& outputs,
                            const std::vector<int>& run, const NetworkFitOptions& options) {
  const rom::Standardization input = column_standardization(inputs);
  return fit(inputs, {input, standardized(inputs, input), rates, outputs, true}, run, options);
}

}  // namespace graupel::train
