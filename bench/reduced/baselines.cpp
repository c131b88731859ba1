#include "bench/reduced/baselines.h"

#include <algorithm>

#include "compare/metrics/displacement_error.h"
#include "core/system/error.h"

namespace graupel::bench {

using namespace experiments;

namespace {

BaselineErrors errors_of(const compare::DisplacementError& error) {
  return {error.delta(), error.displacement_relative()};
}

}  // namespace

Baselines baselines_of_run(const TrainingRuns& train, const io::TrajectoryReader& split, int i) {
  const auto frames = std::min(train.frames(), static_cast<int64_t>(split.header(i).frame_count()));
  const std::vector<double> own = parameter_values(split, i);
  const TrainingMix nearest = nearest_run(train.parameters(), own);
  const std::optional<TrainingMix> around = runs_around(train.parameters(), own);
  const std::vector<Vec3f> reference = split.frames(i, 0, 1).front().position;
  if (train.particles(nearest.runs.front()) != reference.size())
    throw InputError("the training runs have other particles than the runs beside them. Make the data set again");
  compare::DisplacementError still(reference), near(reference), linear(reference);
  for (int64_t f = 1; f < frames; ++f) {
    const std::vector<Vec3f> truth = split.frames(i, f, 1).front().position;
    still.add(truth, reference);
    near.add(truth, train.positions(nearest, f));
    if (around) linear.add(truth, train.positions(*around, f));
  }
  Baselines answers{errors_of(still), errors_of(near), std::nullopt};
  if (around) answers.linear = errors_of(linear);
  return answers;
}

}  // namespace graupel::bench
