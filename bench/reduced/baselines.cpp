#include "bench/reduced/baselines.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

std::vector<Vec3d> mixed(const io::TrajectoryReader& train, const TrainingPair& pair, int64_t frame) {
  const std::vector<Vec3f> a = positions(train, pair.first, frame),
                           b = pair.fraction > 0 ? positions(train, pair.second, frame) : a;
  std::vector<Vec3d> result;
  for (std::size_t p = 0; p < a.size(); ++p)
    result.push_back((1 - pair.fraction) * a[p].cast<double>() + pair.fraction * b[p].cast<double>());
  return result;
}

BaselineErrors errors_of(const compare::DisplacementError& error) {
  return {error.delta(), error.displacement_relative()};
}

}  // namespace

TrainingPair nearest_run(const std::vector<std::vector<double>>& runs, const std::vector<double>& parameters) {
  TrainingPair nearest;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t run = 0; run < runs.size(); ++run) {
    double distance2 = 0;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      double low = runs[0][i], high = low;
      for (const auto& other : runs) {
        low = std::min(low, other[i]);
        high = std::max(high, other[i]);
      }
      const double d = (runs[run][i] - parameters[i]) / (high > low ? high - low : 1);
      distance2 += d * d;
    }
    if (distance2 >= least) continue;
    least = distance2;
    nearest.first = nearest.second = static_cast<int>(run);
  }
  return nearest;
}

std::optional<TrainingPair> runs_beside(const std::vector<std::vector<double>>& runs,
                                        const std::vector<double>& parameters) {
  if (parameters.size() != 1) return std::nullopt;
  const double mu = parameters[0];
  int below = -1, above = -1;
  for (int run = 0; run < static_cast<int>(runs.size()); ++run) {
    const auto value = [&](int r) { return runs[static_cast<std::size_t>(r)][0]; };
    if (value(run) <= mu && (below < 0 || value(run) > value(below))) below = run;
    if (value(run) >= mu && (above < 0 || value(run) < value(above))) above = run;
  }
  if (below < 0 || above < 0) return std::nullopt;
  const double low = runs[static_cast<std::size_t>(below)][0], high = runs[static_cast<std::size_t>(above)][0];
  return TrainingPair{below, above, high > low ? (mu - low) / (high - low) : 0};
}

Baselines baselines_of_run(const io::TrajectoryReader& train, const io::TrajectoryReader& split, int i) {
  std::vector<std::vector<double>> runs;
  std::size_t frames = split.header(i).frame_count();
  for (int run = 0; run < train.count(); ++run) {
    runs.push_back(parameters_of(train, run));
    frames = std::min(frames, train.header(run).frame_count());
  }
  const std::vector<double> own = parameters_of(split, i);
  const TrainingPair nearest = nearest_run(runs, own);
  const std::optional<TrainingPair> beside = runs_beside(runs, own);
  const std::vector<Vec3f> reference = positions(split, i, 0);
  if (positions(train, nearest.first, 0).size() != reference.size())
    throw InputError("the training runs have other particles than the runs beside them. Make the data set again");
  compare::DisplacementError still(reference), near(reference), linear(reference);
  for (int64_t f = 1; f < static_cast<int64_t>(frames); ++f) {
    const std::vector<Vec3f> truth = positions(split, i, f);
    still.add(truth, reference);
    near.add(truth, mixed(train, nearest, f));
    if (beside) linear.add(truth, mixed(train, *beside, f));
  }
  Baselines answers{errors_of(still), errors_of(near), std::nullopt};
  if (beside) answers.linear = errors_of(linear);
  return answers;
}

}  // namespace graupel::bench
