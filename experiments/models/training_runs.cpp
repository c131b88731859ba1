#include "experiments/models/training_runs.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <utility>

#include "core/system/error.h"
#include "experiments/models/body_points.h"
#include "experiments/models/scene_difference.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

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

/// Ways to choose `k` of `n`, above most_simplices at least that.
std::size_t choices(std::size_t n, std::size_t k) {
  std::size_t count = 1;
  for (std::size_t i = 1; i <= k && count <= most_simplices * n; ++i) count = count * (n - k + i) / i;
  return count;
}

/// w of sum w_i = 1, sum w_i offset_i = 0; none where the runs span no simplex.
std::optional<std::vector<double>> barycentric(const std::vector<Eigen::VectorXd>& offsets,
                                               const std::vector<int>& corners) {
  const auto n = static_cast<Eigen::Index>(corners.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Ones(n, n);
  for (Eigen::Index c = 0; c < n; ++c)
    matrix.col(c).tail(n - 1) = offsets[static_cast<std::size_t>(corners[static_cast<std::size_t>(c)])];
  const Eigen::FullPivLU<Eigen::MatrixXd> factor(matrix);
  if (!factor.isInvertible()) return std::nullopt;
  const Eigen::VectorXd w = factor.solve(Eigen::VectorXd::Unit(n, 0));
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
  const std::size_t corners = parameters.size() + 1;
  if (near.size() < corners) return std::nullopt;
  // With one parameter the neighbours may be far beyond the nearest runs of one side.
  while (parameters.size() > 1 && near.size() > corners && choices(near.size(), corners) > most_simplices)
    near.pop_back();
  std::optional<TrainingMix> best;
  double least = std::numeric_limits<double>::infinity();
  std::vector<bool> chosen(near.size(), false);
  std::fill_n(chosen.begin(), corners, true);
  do {
    TrainingMix mix;
    for (std::size_t i = 0; i < near.size(); ++i)
      if (chosen[i]) mix.runs.push_back(near[i]);
    const auto weights = barycentric(offsets, mix.runs);
    if (!weights || *std::min_element(weights->begin(), weights->end()) < -1e-9) continue;
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

std::optional<TrainingMix> runs_beyond(const std::vector<std::vector<double>>& runs,
                                       const std::vector<double>& parameters) {
  const std::vector<Eigen::VectorXd> offsets = offsets_of(runs, parameters);
  const std::vector<int> near = by_distance(offsets);
  const std::size_t corners = parameters.size() + 1;
  std::size_t candidates = near.size();
  if (candidates < corners) return std::nullopt;
  while (candidates > corners && choices(candidates, corners) > most_simplices) --candidates;
  std::vector<bool> chosen(candidates, false);
  std::fill_n(chosen.begin(), corners, true);
  do {  // the nearest runs come first
    TrainingMix mix;
    for (std::size_t i = 0; i < candidates; ++i)
      if (chosen[i]) mix.runs.push_back(near[i]);
    if (auto weights = barycentric(offsets, mix.runs)) {
      mix.weights = std::move(*weights);
      return mix;
    }
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
  return std::nullopt;
}

std::vector<double> parameter_values(const io::TrajectoryReader& reader, int run) {
  std::vector<double> values;
  for (const io::NamedValue& p : reader.parameters(run)) values.push_back(p.value);
  return values;
}

namespace {

constexpr double least_weight = 1e-9;  ///< of a run that counts in a mix

std::string file_of(const std::string& path) {
  return std::filesystem::is_directory(path) ? (std::filesystem::path(path) / "train.h5").string() : path;
}

}  // namespace

TrainingRuns::TrainingRuns(const std::string& path) : file_(file_of(path)), reader_(file_) {
  if (reader_.count() == 0) throw InputError("'" + file_ + "' holds no run. Make the data set again");
  named_ = reader_.parameters(0);
  if (named_.empty())
    throw InputError("the runs of '" + file_ +
                     "' have no parameters (allowed: data sets of a sweep's recipe). Name the data set that the "
                     "reduced-order model was trained on");
  frames_ = std::numeric_limits<int64_t>::max();
  for (int run = 0; run < reader_.count(); ++run) {
    parameters_.push_back(parameter_values(reader_, run));
    if (parameters_.back().size() != named_.size())
      throw InputError(fmt::format("run {} of '{}' has {} parameters, run 0 has {}. Make the data set again", run,
                                   file_, parameters_.back().size(), named_.size()));
    frames_ = std::min(frames_, static_cast<int64_t>(reader_.header(run).frame_count()));
  }
}

std::vector<double> TrainingRuns::parameters_in(const Scene& scene, uint64_t seed, int64_t frames) const {
  const Trajectory first = reader_.header(0);
  const auto refuse = [&](const std::string& what, const std::string& own, const std::string& theirs) {
    throw ConfigError(fmt::format(
        "the training runs of '{}' are not of the scene '{}': {} is {} in the scene and {} in the runs. Name the data "
        "set of that scene with --training-runs, or leave it out",
        file_, scene.name, what, own, theirs));
  };
  std::vector<std::string> keys;
  for (const io::NamedValue& p : named_) keys.insert(keys.end(), p.keys.begin(), p.keys.end());
  const std::string own = io::scene_to_json(scene),
                    theirs = io::scene_to_json(io::parse_stored_scene(first.scene_json, file_, file_));
  if (const auto difference = scene_difference(own, theirs, keys, discretisation_keys(theirs)))
    refuse("'" + difference->key + "'", difference->own, difference->other);
  if (seed != first.seed && !scene_difference(own, theirs, keys))
    refuse("the seed", std::to_string(seed), std::to_string(first.seed));
  if (std::abs(scene.frame_time - first.frame_time) > 1e-9 * scene.frame_time)
    refuse("'/frame_time'", fmt::format("{:g} s", scene.frame_time), fmt::format("{:g} s", first.frame_time));
  if (frames >= frames_) refuse("the number of frames", std::to_string(frames), fmt::format("at most {}", frames_ - 1));
  std::vector<double> values;
  for (const io::NamedValue& p : named_) values.push_back(number_at(own, p.keys.front(), file_));
  return values;
}

std::vector<std::string> TrainingRuns::names() const {
  std::vector<std::string> names;
  for (const io::NamedValue& p : named_) names.push_back(p.name);
  return names;
}

std::size_t TrainingRuns::particles(int run) const { return reader_.header(run).particle_count(); }

Scene TrainingRuns::scene() const {
  const Trajectory first = reader_.header(0);
  Scene scene = io::parse_stored_scene(first.scene_json, file_, file_);
  scene.seed = first.seed;
  return scene;
}

std::vector<Vec3d> TrainingRuns::positions(const TrainingMix& mix, int64_t frame) const {
  std::vector<Vec3d> result;
  for (std::size_t i = 0; i < mix.runs.size(); ++i) {
    if (std::abs(mix.weights[i]) < least_weight) continue;
    const std::vector<Vec3f> x = reader_.frames(mix.runs[i], frame, 1).front().position;
    result.resize(x.size(), Vec3d::zero());
    for (std::size_t p = 0; p < x.size(); ++p) result[p] += mix.weights[i] * x[p].cast<double>();
  }
  return result;
}

std::string TrainingRuns::text(const TrainingMix& mix) const {
  std::string text;
  for (std::size_t i = 0; i < mix.runs.size(); ++i) {
    if (std::abs(mix.weights[i]) < least_weight) continue;
    const auto run = static_cast<std::size_t>(mix.runs[i]);
    if (mix.runs.size() > 1) text += fmt::format("{}{:.3g} x ", text.empty() ? "" : " + ", mix.weights[i]);
    text += named_.size() == 1 ? fmt::format("{:g}", parameters_[run][0]) : fmt::format("run {}", run);
  }
  return named_.size() == 1 ? named_[0].name + " " + text : text;
}

}  // namespace graupel::experiments
