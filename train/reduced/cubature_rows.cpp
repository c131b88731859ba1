#include "train/reduced/cubature_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "mpm/physics/stencil.h"

namespace graupel::train {

namespace {

/// Sweeps over all points, at most, and the part of the squared error that a sweep must take away for another one.
constexpr int point_sweeps = 10;
constexpr double point_gain = 1e-2;

/// Numbers of the nodes that particles touch, row by row, so that a stencil's nodes along the last axis follow each
/// other.
class NodeNumbers {
 public:
  explicit NodeNumbers(const std::vector<Vec<int, 3>>& bases) : low_(bases.front()) {
    Vec<int, 3> high = bases.front();
    for (const Vec<int, 3>& base : bases)
      for (int d = 0; d < 3; ++d) {
        low_[d] = std::min(low_[d], base[d]);
        high[d] = std::max(high[d], base[d]);
      }
    for (int d = 0; d < 3; ++d) size_[d] = high[d] - low_[d] + width;
    number_.assign(static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1] * size_[2]), -1);
    for (const Vec<int, 3>& base : bases)
      for (int row = 0; row < width * width; ++row) std::fill_n(number_.begin() + offset(base, row), width, 0);
    for (int32_t& n : number_)
      if (n == 0) n = count_++;
  }
  int32_t count() const { return count_; }
  int32_t first(const Vec<int, 3>& base, int row) const { return number_[static_cast<std::size_t>(offset(base, row))]; }

 private:
  static constexpr int width = mpm::stencil_width<>;
  int64_t offset(const Vec<int, 3>& base, int row) const {
    const int64_t x = base[0] - low_[0] + row / width, y = base[1] - low_[1] + row % width, z = base[2] - low_[2];
    return (x * size_[1] + y) * size_[2] + z;
  }
  Vec<int, 3> low_, size_;
  std::vector<int32_t> number_;
  int32_t count_ = 0;
};

}  // namespace

/// Calls use(node, {mass, force}) for the nodes of a place.
template <typename Use>
void NodalSums::at_nodes(const Place& place, const Load& load, const Use& use) {
  mpm::AxisWeights<float> w[3];
  for (int d = 0; d < 3; ++d) w[d] = mpm::bspline_weights(place.above[static_cast<std::size_t>(d)]);
  const auto& s = load.stress;
  for (int row = 0; row < 9; ++row) {
    const int i = row / 3, j = row % 3;
    const float wij = w[0].w[i] * w[1].w[j];
    const float x = static_cast<float>(i) - place.above[0], y = static_cast<float>(j) - place.above[1];
    for (int k = 0; k < 3; ++k) {
      const float z = static_cast<float>(k) - place.above[2], weight = wij * w[2].w[k];
      const auto times = [weight](float value) { return static_cast<double>(weight * value); };
      use(static_cast<std::size_t>(place.first[static_cast<std::size_t>(row)] + k),
          Sums{times(load.mass), -times(s[0] * x + s[1] * y + s[2] * z), -times(s[1] * x + s[3] * y + s[4] * z),
               -times(s[2] * x + s[4] * y + s[5] * z)});
    }
  }
}

NodalSums::NodalSums(const QuadratureBody& body, const std::vector<QuadratureSnapshot>& snapshots)
    : members_(static_cast<std::size_t>(body.clusters.count)),
      points_(body.clusters.representatives()),
      snapshots_(snapshots.size()) {
  for (std::size_t p = 0; p < body.mass.size(); ++p)
    members_[static_cast<std::size_t>(body.clusters.of_particle[p])].push_back(static_cast<int32_t>(p));
  const auto make = [&](int64_t i) {
    snapshots_[static_cast<std::size_t>(i)] = prepare(body, snapshots[static_cast<std::size_t>(i)]);
  };
  parallel_for_cpu(static_cast<int64_t>(snapshots.size()), make, Grain{1});
}

NodalSums::Snapshot NodalSums::prepare(const QuadratureBody& body, const QuadratureSnapshot& state) {
  const std::size_t n = body.mass.size();
  std::vector<Vec<int, 3>> bases(n);
  Snapshot made;
  made.places.resize(n);
  for (std::size_t p = 0; p < n; ++p) {
    Vec3d local;
    for (int d = 0; d < 3; ++d)
      local[d] = (static_cast<double>(state.position[3 * p + static_cast<std::size_t>(d)]) - body.origin[d]) / body.dx;
    const mpm::Stencil<double, 3> stencil = mpm::stencil_at(local);
    bases[p] = stencil.base;
    for (int d = 0; d < 3; ++d) made.places[p].above[static_cast<std::size_t>(d)] = static_cast<float>(stencil.fx[d]);
  }
  const NodeNumbers numbers(bases);
  made.targets.assign(static_cast<std::size_t>(numbers.count()), {});
  for (std::size_t p = 0; p < n; ++p) {
    for (int row = 0; row < 9; ++row)
      made.places[p].first[static_cast<std::size_t>(row)] = numbers.first(bases[p], row);
    Load load{static_cast<float>(body.mass[p]), {}};
    for (std::size_t c = 0; c < 6; ++c)
      load.stress[c] = static_cast<float>(4 / body.dx * body.volume[p]) * state.stress[6 * p + c];
    at_nodes(made.places[p], load, [&](std::size_t node, const Sums& part) {
      for (std::size_t k = 0; k < channels; ++k) made.targets[node][k] += part[k];
    });
  }
  for (const Sums& sum : made.targets) made.scale.push_back(sum[0] > 0 ? 1 / std::sqrt(sum[0]) : 0);
  made.loads = cluster_loads(body, state);
  return made;
}

/// A point has its cluster's mass, volume and mean stress.
std::vector<NodalSums::Load> NodalSums::cluster_loads(const QuadratureBody& body, const QuadratureSnapshot& state) {
  const auto count = static_cast<std::size_t>(body.clusters.count);
  std::vector<double> mass(count), volume(count), members(count), stress(6 * count);
  for (std::size_t p = 0; p < body.mass.size(); ++p) {
    const auto c = static_cast<std::size_t>(body.clusters.of_particle[p]);
    mass[c] += body.mass[p];
    volume[c] += body.volume[p];
    members[c] += 1;
    for (std::size_t k = 0; k < 6; ++k) stress[6 * c + k] += static_cast<double>(state.stress[6 * p + k]);
  }
  std::vector<Load> loads(count);
  for (std::size_t c = 0; c < count; ++c) {
    loads[c].mass = static_cast<float>(mass[c]);
    for (std::size_t k = 0; k < 6; ++k)
      loads[c].stress[k] = static_cast<float>(4 / body.dx * volume[c] * stress[6 * c + k] / members[c]);
  }
  return loads;
}

std::array<double, 2> NodalSums::squares(double factor) const {
  std::array<double, 2> sum = {};
  for (const Snapshot& snapshot : snapshots_) {
    std::vector<Sums> rest = snapshot.targets;
    for (std::size_t c = 0; c < points_.size(); ++c)
      at_nodes(snapshot.places[static_cast<std::size_t>(points_[c])], snapshot.loads[c],
               [&](std::size_t node, const Sums& part) {
                 for (std::size_t k = 0; k < channels; ++k) rest[node][k] -= factor * part[k];
               });
    for (std::size_t node = 0; node < rest.size(); ++node)
      for (std::size_t k = 0; k < channels; ++k) {
        const double error = snapshot.scale[node] * rest[node][k];
        sum[k == 0 ? 0 : 1] += error * error;
      }
  }
  return sum;
}

QuadratureError NodalSums::error() const {
  const std::array<double, 2> rest = squares(1), all = squares(0);
  return {all[0] > 0 ? std::sqrt(rest[0] / all[0]) : 0, all[1] > 0 ? std::sqrt(rest[1] / all[1]) : 0};
}

/// Coordinate descent: one point after the other goes to its best place, the others kept.
class NodalSums::Descent {
 public:
  explicit Descent(const NodalSums& sums) : snapshots_(sums.snapshots_), points_(sums.points_) {
    const std::array<double, 2> start = sums.squares(1);
    for (std::size_t k = 0; k < channels; ++k) {
      const double square = start[k == 0 ? 0 : 1];
      factor_[k] = square > 0 ? 1 / std::sqrt(square) : 0;
    }
    for (const Snapshot& s : snapshots_) {
      residual_.emplace_back(s.targets.size());
      for (std::size_t node = 0; node < s.targets.size(); ++node)
        for (std::size_t k = 0; k < channels; ++k)
          residual_.back()[node][k] = -s.scale[node] * factor_[k] * s.targets[node][k];
    }
    for (std::size_t c = 0; c < points_.size(); ++c) add(c, points_[c], 1);
  }

  const std::vector<int32_t>& points() const { return points_; }

  /// Calls visit(point) for all points until a sweep takes less than `gain` of the squared error away.
  template <typename Visit>
  void sweep(int most, double gain, const Visit& visit) {
    double before = error2();
    for (int i = 0; i < most; ++i) {
      for (std::size_t c = 0; c < points_.size(); ++c) visit(c);
      const double current = error2();
      if (before - current <= gain * before) break;
      before = current;
    }
  }
  /// The particle of least error.
  void choose(std::size_t c, const std::vector<int32_t>& members) {
    add(c, points_[c], -1);
    double least = std::numeric_limits<double>::infinity();
    for (const int32_t member : members) {
      const Line line = line_of(c, member);
      const double error = 2 * line.slope + line.square;
      if (error >= least) continue;
      least = error;
      points_[c] = member;
    }
    add(c, points_[c], 1);
  }

 private:
  /// Squared error by a point with the weight w: r^2 + 2 slope w + square w^2.
  struct Line {
    double slope = 0, square = 0;
  };

  double error2() const {
    double sum = 0;
    for (const auto& snapshot : residual_)
      for (const Sums& node : snapshot)
        for (const double value : node) sum += value * value;
    return sum;
  }
  /// Calls use(a, r) for the rows of a point's column: its part of the scaled sums at a node, and what these are off.
  template <typename Use>
  void column(std::size_t c, int32_t particle, const Use& use) {
    for (std::size_t s = 0; s < residual_.size(); ++s) {
      const Snapshot& snapshot = snapshots_[s];
      at_nodes(snapshot.places[static_cast<std::size_t>(particle)], snapshot.loads[c],
               [&](std::size_t node, const Sums& part) {
                 Sums a;
                 for (std::size_t k = 0; k < channels; ++k) a[k] = factor_[k] * snapshot.scale[node] * part[k];
                 use(a, residual_[s][node]);
               });
    }
  }
  Line line_of(std::size_t c, int32_t particle) {
    Line line;
    column(c, particle, [&](const Sums& a, const Sums& r) {
      for (std::size_t k = 0; k < channels; ++k) {
        line.slope += a[k] * r[k];
        line.square += a[k] * a[k];
      }
    });
    return line;
  }
  void add(std::size_t c, int32_t particle, double weight) {
    column(c, particle, [&](const Sums& a, Sums& r) {
      for (std::size_t k = 0; k < channels; ++k) r[k] += weight * a[k];
    });
  }

  const std::vector<Snapshot>& snapshots_;
  std::vector<int32_t> points_;
  Sums factor_;
  std::vector<std::vector<Sums>> residual_;  ///< sums of the points less those of all particles, scaled
};

void NodalSums::choose_points() {
  Descent descent(*this);
  descent.sweep(point_sweeps, point_gain, [&](std::size_t c) { descent.choose(c, members_[c]); });
  points_ = descent.points();
}

}  // namespace graupel::train
