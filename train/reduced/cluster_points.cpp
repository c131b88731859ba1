#include "train/reduced/cluster_points.h"

#include <algorithm>
#include <cmath>

#include "core/system/stopwatch.h"
#include "io/scene/scene_reader.h"
#include "mpm/grid/grid.h"

namespace graupel::train {

namespace {

constexpr int64_t held_out = 4;  ///< snapshots

/// `count` snapshots from number `first` on, of an order that spreads them over runs and frames.
std::vector<QuadratureSnapshot> read_snapshots(const SnapshotSet& set, int64_t first, int64_t count) {
  constexpr double golden =
      0.6180339887498949;  // fractions of its multiples fill [0, 1) evenly, however many there are
  std::vector<QuadratureSnapshot> snapshots;
  for (int64_t i = first; i < first + count; ++i) {
    const double golden_multiple = static_cast<double>(i + 1) * golden,
                 fraction = golden_multiple - std::floor(golden_multiple);
    const auto run = static_cast<int>(i % set.runs());
    const int64_t frames = set.first_snapshot(run + 1) - set.first_snapshot(run);
    const int64_t snapshot =
        set.first_snapshot(run) + std::min(frames - 1, static_cast<int64_t>(fraction * static_cast<double>(frames)));
    snapshots.push_back({set.read(SnapshotField::position, snapshot), set.read(SnapshotField::stress, snapshot)});
  }
  return snapshots;
}

}  // namespace

ClusterPoints match_cluster_points(const SnapshotSet& set, const rom::Clusters& clusters, int64_t snapshots) {
  const Stopwatch watch;
  ClusterPoints fit;
  const auto read = read_snapshots(set, 0, snapshots), others = read_snapshots(set, snapshots, held_out);
  fit.read_seconds = watch.seconds();
  const auto grid = mpm::grid_of<double>(io::parse_stored_scene(set.scene_json(), set.file(), set.file()).domain);
  const auto body_of = [&](const rom::Clusters& some) {
    return QuadratureBody{some, set.particle_mass(), set.particle_volume(), grid.origin, grid.dx};
  };
  fit.before = NodalSums(body_of(clusters), others).error();
  NodalSums sums(body_of(clusters), read);
  sums.choose_points();
  fit.points = sums.points();
  rom::Clusters fitted = clusters;
  fitted.points = fit.points;
  fit.after = NodalSums(body_of(fitted), others).error();
  fit.seconds = watch.seconds();
  return fit;
}

}  // namespace graupel::train
