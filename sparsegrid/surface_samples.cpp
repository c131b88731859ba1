// Poisson-disk points on level sets. Each grid cell that the surface crosses is cut into sub-cells of 2/3 spacing; one
// random point of each sub-cell near the surface is moved onto the zero of the trilinear interpolant along its gradient
// (Newton). These candidates lie denser than the spacing. A candidate is taken unless a taken one is closer than the
// spacing (dart throwing), so each refused one has a taken one within the spacing and no hole stays.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/math/random.h"
#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "sparsegrid/analytic_shape.h"
#include "sparsegrid/cell_normals.h"
#include "sparsegrid/poisson_disk.h"
#include "sparsegrid/push_out.h"

namespace graupel::sparsegrid {

namespace {

constexpr double strata_per_spacing = 1.5;
/// Candidates of obstacles are kept until they are so many, and are then tried together: there are five to ten of them
/// to a sample, so that those of a thousand obstacles would fill the memory, and miss every cache.
constexpr std::size_t most_waiting = std::size_t{1} << 22;

bool is_left_out(const SurfaceChoice& choice, int obstacle) {
  return !choice.left_out.empty() && choice.left_out[static_cast<std::size_t>(obstacle)];
}

/// Takes points and normals of one obstacle, in the world.
class Candidates {
 public:
  Candidates(const Scene& scene, const ObstacleSetView& set, int obstacle, const SurfaceChoice& choice)
      : low_(scene.domain.origin),
        high_(scene.domain.origin + scene.domain.size),
        set_(set),
        obstacle_(obstacle),
        choice_(choice) {}

  void add(SurfaceSamples& out, const Vec3d& local, const Vec3d& local_normal) const {
    const ObstacleFrame<double>& own = set_.obstacles[obstacle_].exact;
    const Vec3d x = own.rotation * local + own.position;
    if (!choice_.is_whole && !lookup::in_box(x, low_, high_)) return;
    bool covered = false;
    set_.near(x).for_each([&](int32_t i) {
      covered = covered || (i != obstacle_ && !is_left_out(choice_, i) && lookup::may_be_inside(set_.obstacles[i], x) &&
                            signed_distance(set_.obstacles[i], x).phi < 0);
    });
    if (covered) return;
    out.position.push_back(x);
    out.normal.push_back(own.rotation * local_normal);
  }

 private:
  Vec3d low_, high_;
  const ObstacleSetView& set_;
  int obstacle_;
  const SurfaceChoice& choice_;
};

/// Candidates of several obstacles, in pieces as they were found.
struct Waiting {
  std::vector<std::vector<Vec3d>> position, normal;
  std::size_t count = 0;

  void add(SurfaceSamples&& piece) {
    if (piece.position.empty()) return;
    count += piece.position.size();
    position.push_back(std::move(piece.position));
    normal.push_back(std::move(piece.normal));
  }
};

/// Corner values of the grid cell above voxel `base` [voxels]; false when the surface does not cross it.
bool crossed_cell(const ObstacleView& view, const Vec3i& base, double (&v)[2][2][2]) {
  lookup::read_corners(view, base, v);
  int inside = 0;
  for (double* value = &v[0][0][0]; value != &v[0][0][0] + 8; ++value) {
    *value *= view.exact.inverse_voxel;
    inside += *value < 0;
  }
  return inside > 0 && inside < 8;
}

/// Moves t onto the zero of the interpolant inside the cell [0, 1]^3; false when there is none within `reach` of t.
bool to_surface(const double (&v)[2][2][2], double reach, Vec3d& t, Vec3d& gradient) {
  double phi = lookup::trilinear(v, t, gradient);
  if (phi * phi > reach * reach * norm2(gradient)) return false;
  for (int step = 0; step < 4 && std::abs(phi) > 1e-6; ++step) {
    t -= gradient * (phi / norm2(gradient));
    phi = lookup::trilinear(v, t, gradient);
    if (!(norm2(gradient) > 1e-4)) return false;
  }
  const bool inside = std::all_of(t.a, t.a + 3, [](double u) { return u >= -1e-6 && u <= 1 + 1e-6; });
  return inside && std::abs(phi) < 1e-5;
}

/// Candidates on the zero of a grid, leaf by leaf.
void grid_candidates(const Candidates& candidates, const ObstacleView& view, const Random& random, double spacing,
                     Waiting& waiting) {
  const double voxel = 1 / view.exact.inverse_voxel;
  const int strata = std::max(1, static_cast<int>(std::ceil(strata_per_spacing * voxel / spacing)));
  const int64_t per_cell = int64_t(strata) * strata * strata;
  const double reach = 0.5 * std::sqrt(3.0) / strata;
  const auto& tree = view.grid->tree();
  const auto* leaves = tree.getFirstNode<0>();
  std::vector<SurfaceSamples> found(tree.nodeCount(0));
  const auto sample_leaf = [&](int64_t leaf) {
    const auto l = static_cast<std::size_t>(leaf);
    double v[2][2][2];
    for (uint32_t n = 0; n < 512; ++n) {
      if (std::abs(leaves[l].getValue(n)) > 1.8 * voxel) continue;  // farther than a cell's diagonal
      const nanovdb::Coord corner = leaves[l].offsetToGlobalCoord(n);
      const Vec3i base = {corner.x(), corner.y(), corner.z()};
      if (!crossed_cell(view, base, v)) continue;
      for (int64_t s = 0; s < per_cell; ++s) {
        const auto index = static_cast<uint64_t>((static_cast<int64_t>(l) * 512 + n) * per_cell + s);
        const auto word = random.words(index);
        const int64_t sub[3] = {s % strata, s / strata % strata, s / strata / strata};
        Vec3d t, gradient;
        for (int d = 0; d < 3; ++d) t[d] = (static_cast<double>(sub[d]) + word.v[d] * 0x1p-32) / strata;
        if (!to_surface(v, reach, t, gradient)) continue;
        t += base.cast<double>();
        candidates.add(found[l], t * voxel, normalized(gradient));
      }
    }
  };
  parallel_for_cpu(static_cast<int64_t>(found.size()), sample_leaf, Grain{16});
  for (SurfaceSamples& one : found) waiting.add(std::move(one));
}

/// Candidates on the plane y = 0 below the domain.
void plane_candidates(const Candidates& candidates, const LocalBox& box, const Random& random, double spacing,
                      Waiting& waiting) {
  const double step = spacing / strata_per_spacing;
  const auto columns = static_cast<int64_t>(std::ceil((box.high[0] - box.low[0]) / step));
  const auto rows = static_cast<int64_t>(std::ceil((box.high[2] - box.low[2]) / step));
  SurfaceSamples all;
  for (int64_t r = 0; r < rows; ++r)
    for (int64_t c = 0; c < columns; ++c) {
      const auto index = static_cast<uint64_t>(r * columns + c);
      const double x = box.low[0] + (static_cast<double>(c) + random.uniform(index, 0)) * step;
      const double z = box.low[2] + (static_cast<double>(r) + random.uniform(index, 1)) * step;
      candidates.add(all, {x, 0, z}, {0, 1, 0});
    }
  waiting.add(std::move(all));
}

/// Appends the candidates that the board takes.
void throw_darts(const Waiting& waiting, PoissonDisk& board, SurfaceSamples& to) {
  const std::vector<std::vector<char>> taken = board.take(waiting.position);
  for (std::size_t piece = 0; piece < taken.size(); ++piece)
    for (std::size_t i = 0; i < taken[piece].size(); ++i)
      if (taken[piece][i]) {
        to.position.push_back(waiting.position[piece][i]);
        to.normal.push_back(waiting.normal[piece][i]);
      }
}

}  // namespace

SurfaceSamples sample_surface(const Scene& scene, const ObstacleSet& obstacles, double spacing, uint64_t seed,
                              const SurfaceChoice& choice) {
  if (!(spacing > 0)) throw ConfigError("the sample spacing is not positive (" + std::to_string(spacing) + " m)");
  const ObstacleSetView set = obstacles.view();
  Waiting waiting;
  SurfaceSamples taken;
  PoissonDisk board(spacing);
  for (int i = 0; i < set.count; ++i) {
    if (is_left_out(choice, i)) continue;
    const Candidates candidates(scene, set, i, choice);
    const Random random(seed, RandomPurpose::surface_sample, static_cast<uint64_t>(i));
    const ObstacleFrame<double>& pose = set.obstacles[i].exact;
    if (set.obstacles[i].is_plane)
      plane_candidates(candidates, plane_bounds(pose.rotation, pose.position, scene.domain), random, spacing, waiting);
    else
      grid_candidates(candidates, set.obstacles[i], random, spacing, waiting);
    if (waiting.count < most_waiting) continue;
    throw_darts(waiting, board, taken);
    waiting = {};
  }
  throw_darts(waiting, board, taken);
  return taken;
}

}  // namespace graupel::sparsegrid
