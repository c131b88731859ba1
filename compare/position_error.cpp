#include "compare/position_error.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>

#include "core/error.h"
#include "core/held_particles.h"
#include "core/material_config.h"
#include "core/parallel_for.h"

namespace graupel::compare {

std::vector<int32_t> counterparts(const ParticleRun& truth, const ParticleRun& run) {
  const auto& type = truth.trajectory.particle_type;
  const auto& other = run.trajectory.particle_type;
  std::vector<int32_t> counterpart(type.size());
  if (type == other) {
    std::iota(counterpart.begin(), counterpart.end(), 0);
    return counterpart;
  }
  const auto at = [&](int32_t j) -> const Vec3f& { return run.position(0)[j]; };
  std::map<int32_t, std::vector<int32_t>> candidates;  // of each type, ordered by x
  for (std::size_t j = 0; j < other.size(); ++j) candidates[other[j]].push_back(static_cast<int32_t>(j));
  for (const int32_t t : types_of(truth.trajectory))
    if (candidates[t].empty())
      throw InputError("the runs cannot be compared (one has no particle of type " + particle_type_name(t) +
                       "). Use runs of the same scene");
  for (auto& [t, list] : candidates)
    std::sort(list.begin(), list.end(), [&](int32_t a, int32_t b) { return at(a)[0] < at(b)[0]; });
  parallel_for(Device::cpu, static_cast<int64_t>(type.size()), [&](int64_t i) {
    const std::vector<int32_t>& list = candidates.at(type[i]);
    const Vec3f x = truth.position(0)[i];
    float nearest = std::numeric_limits<float>::infinity();
    const auto closer = [&](int32_t j) {
      const float d = norm2(at(j) - x);
      if (d < nearest || (d == nearest && j < counterpart[i])) {
        nearest = d;
        counterpart[i] = j;
      }
    };
    const auto in_reach = [&](int32_t j) { return (at(j)[0] - x[0]) * (at(j)[0] - x[0]) <= nearest; };
    // Outwards from x on both sides, until the distance along this axis alone is too large.
    const auto middle =
        std::lower_bound(list.begin(), list.end(), x[0], [&](int32_t j, float value) { return at(j)[0] < value; });
    auto above = middle, below = middle;
    for (bool more = true; more;) {
      more = false;
      if (above != list.end() && in_reach(*above)) {
        closer(*above++);
        more = true;
      }
      if (below != list.begin() && in_reach(*(below - 1))) {
        closer(*--below);
        more = true;
      }
    }
  });
  return counterpart;
}

namespace {

Vec3d carried_position(const ParticleRun& truth, const ParticleRun& run, bool same, int64_t i, int32_t c,
                       std::size_t f) {
  const Vec3d x = run.position(f)[c].cast<double>();
  if (same) return x;
  return truth.position(0)[i].cast<double>() + x - run.position(0)[c].cast<double>();
}

}  // namespace

std::vector<Vec3d> carried_positions(const ParticleRun& truth, const ParticleRun& run,
                                     const std::vector<int32_t>& counterpart, std::size_t f) {
  const bool same = truth.trajectory.particle_type == run.trajectory.particle_type;
  std::vector<Vec3d> position(truth.size());
  for (std::size_t i = 0; i < position.size(); ++i)
    position[i] = carried_position(truth, run, same, static_cast<int64_t>(i), counterpart[i], f);
  return position;
}

std::vector<double> position_error_curve(const ParticleRun& truth, const ParticleRun& run,
                                         const std::vector<int32_t>& counterpart, int32_t type) {
  const bool same = truth.trajectory.particle_type == run.trajectory.particle_type;
  const std::size_t frames = std::min(truth.predicted(), run.predicted());
  std::vector<double> curve(frames);
  const auto frame_error = [&](int64_t k) {
    const std::size_t f = static_cast<std::size_t>(k) + 1;
    double sum = 0;
    int64_t n = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const int32_t own = truth.trajectory.particle_type[i];
      if (type >= 0 ? own != type : !moves_by_itself(own)) continue;
      const Vec3d x = carried_position(truth, run, same, static_cast<int64_t>(i), counterpart[i], f);
      sum += norm2(x - truth.position(f)[i].cast<double>());
      ++n;
    }
    curve[k] = n > 0 ? sum / static_cast<double>(n) : 0;
  };
  parallel_for(Device::cpu, static_cast<int64_t>(frames), frame_error, Grain{1});
  return curve;
}

double mean_of_first(const std::vector<double>& curve, std::size_t n) {
  n = std::min(n, curve.size());
  if (n == 0) return 0;
  return std::accumulate(curve.begin(), curve.begin() + static_cast<std::ptrdiff_t>(n), 0.0) / static_cast<double>(n);
}

}  // namespace graupel::compare
