#include "rom/interpolation_bound.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mpm/particles/particles.h"
#include "rom/projection/latent_manifold.h"
#include "rom/reduced_model.h"

namespace graupel::rom {

namespace {

constexpr std::size_t most_points = 1000;  ///< which give the error of a run to some percent of itself

/// The training runs in the order of their one parameter.
struct OrderedRuns {
  std::vector<double> values;
  std::vector<Eigen::MatrixXd> latents;  ///< [r, snapshots] each
};

/// None where the runs cannot be interpolated.
std::optional<OrderedRuns> ordered_runs(const ReducedModel& model) {
  const std::size_t runs = model.run_parameters.size();
  if (model.parameters.size() != 1 || runs < 3 || model.training_run.size() % runs != 0) return std::nullopt;
  const std::size_t length = model.training_run.size() / runs;
  for (std::size_t i = 0; i < model.training_run.size(); ++i)
    if (model.training_run[i] != static_cast<int32_t>(i / length)) return std::nullopt;
  std::vector<std::size_t> order(runs);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return model.run_parameters[a] < model.run_parameters[b]; });
  OrderedRuns ordered;
  const auto r = static_cast<Eigen::Index>(model.latents()), n = static_cast<Eigen::Index>(length);
  for (const std::size_t run : order) {
    const auto value = static_cast<double>(model.run_parameters[run]);
    if (!ordered.values.empty() && value <= ordered.values.back()) return std::nullopt;
    ordered.values.push_back(value);
    const float* first = model.training_latents.data() + run * length * static_cast<std::size_t>(r);
    ordered.latents.emplace_back(Eigen::Map<const Eigen::MatrixXf>(first, r, n).cast<double>());
  }
  return ordered;
}

/// The lower of the two runs whose line gives the parameter; outside of the range the two outermost.
std::size_t below(const std::vector<double>& values, double value) {
  std::size_t low = 0;
  while (low + 2 < values.size() && values[low + 1] < value) ++low;
  return low;
}

Eigen::MatrixXd line_between(const OrderedRuns& runs, std::size_t low, std::size_t high, double value) {
  const double from = runs.values[low], fraction = (value - from) / (runs.values[high] - from);
  return (1 - fraction) * runs.latents[low] + fraction * runs.latents[high];
}

double squared_distance(const Eigen::VectorXf& a, const Eigen::VectorXf& b) {
  return (a - b).cast<double>().squaredNorm();
}

}  // namespace

BoundPoints::BoundPoints(const ReducedModel& model) {
  const std::vector<int32_t>& all = model.encoder;
  const std::size_t count = std::min(most_points, all.size());
  for (std::size_t i = 0; i < count; ++i) particles_.push_back(all[i * all.size() / count]);
  field_ = model.fields->bind_positions_f32(particles_);
  tiles_.resize(3 * static_cast<std::size_t>(mpm::padded_to_tile(static_cast<int64_t>(count))));
  reference_.resize(static_cast<Eigen::Index>(3 * count));
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t d = 0; d < 3; ++d)
      reference_[static_cast<Eigen::Index>(3 * i + d)] =
          model.reference[3 * static_cast<std::size_t>(particles_[i]) + d];
}

Eigen::VectorXf BoundPoints::positions(const Eigen::VectorXd& latent) {
  LatentState state;
  state.latent.assign(latent.begin(), latent.end());
  state.velocity.assign(state.latent.size(), 0);
  field_->decode(state, tiles_.data());
  Eigen::VectorXf x(reference_.size());
  for (int64_t i = 0; i < static_cast<int64_t>(particles_.size()); ++i) {
    const Vec3f at = mpm::TiledView<float, 3>{tiles_.data()}.vec(i);
    for (int d = 0; d < 3; ++d) x[3 * i + d] = at[d];
  }
  return x;
}

std::optional<double> interpolation_curvature(const ReducedModel& model) {
  const std::optional<OrderedRuns> runs = ordered_runs(model);
  if (!runs) return std::nullopt;
  BoundPoints points(model);
  double largest = 0;
  for (std::size_t run = 1; run + 1 < runs->values.size(); ++run) {
    const Eigen::MatrixXd line = line_between(*runs, run - 1, run + 1, runs->values[run]);
    double distance2 = 0, displacement2 = 0;
    for (Eigen::Index f = 0; f < line.cols(); ++f) {
      const Eigen::VectorXf x = points.positions(runs->latents[run].col(f));
      distance2 += squared_distance(points.positions(line.col(f)), x);
      displacement2 += squared_distance(x, points.reference());
    }
    if (displacement2 == 0) continue;
    const double spacing2 = (runs->values[run] - runs->values[run - 1]) * (runs->values[run + 1] - runs->values[run]);
    largest = std::max(largest, 2 * std::sqrt(distance2 / displacement2) / spacing2);
  }
  return largest;
}

std::optional<InterpolationBound> InterpolationBound::of(const ReducedModel& model, double parameter) {
  const std::optional<OrderedRuns> runs = model.interpolation ? ordered_runs(model) : std::nullopt;
  if (!runs) return std::nullopt;
  const std::size_t low = below(runs->values, parameter), high = low + 1;
  const double remainder = 0.5 * model.interpolation->curvature *
                           std::abs((parameter - runs->values[low]) * (parameter - runs->values[high]));
  return InterpolationBound(model, line_between(*runs, low, high, parameter),
                            model.interpolation->reconstruction + safety * remainder);
}

InterpolationBound::InterpolationBound(const ReducedModel& model, Eigen::MatrixXd line, double interpolation_error)
    : points_(model),
      line_(std::move(line)),
      frame_time_(model.frame_time),
      interpolation_error_(interpolation_error) {}

void InterpolationBound::add(const std::vector<double>& latent, double time) {
  const double place = time / frame_time_;
  constexpr double rounding = 1e-6;
  if (place > static_cast<double>(line_.cols() - 1) + rounding) beyond_ = true;
  if (beyond_) return;
  const auto before = std::min(static_cast<Eigen::Index>(place), line_.cols() - 2);
  const double fraction = place - static_cast<double>(before);
  const Eigen::VectorXf on_line =
      points_.positions((1 - fraction) * line_.col(before) + fraction * line_.col(before + 1));
  const Eigen::Map<const Eigen::VectorXd> q(latent.data(), static_cast<Eigen::Index>(latent.size()));
  distance2_ += squared_distance(points_.positions(q), on_line);
  displacement2_ += squared_distance(on_line, points_.reference());
}

std::optional<double> InterpolationBound::value() const {
  if (beyond_ || displacement2_ == 0) return std::nullopt;
  return std::sqrt(distance2_ / displacement2_) + interpolation_error_;
}

}  // namespace graupel::rom
