#include "graph/free_flight.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/error.h"
#include "core/parallel_for_in.h"
#include "graph/free_flight_kernels.h"

namespace graupel::graph {

using namespace flight;

namespace {

constexpr Grain light{.items = 1024};
constexpr int64_t most_cells = int64_t{1} << 23;
/// Quadratic B-splines: particles share a node of MPM's grid up to three of its cells apart, and touch an obstacle up
/// to two.
constexpr double group_cells = 3, contact_cells = 2;

Cells cells_of(const Surroundings& surroundings, double spacing) {
  Cells cells{};
  for (int64_t count = most_cells + 1; count > most_cells; spacing *= 2) {
    cells.inverse_spacing = static_cast<float>(1 / spacing);
    count = 1;
    for (int d = 0; d < 3; ++d) {
      const double length = surroundings.wall_high[d] - surroundings.wall_low[d];
      cells.size[d] = static_cast<int>(std::ceil(length / spacing)) + 2;
      count *= cells.size[d];
    }
    cells.origin = (surroundings.wall_low - Vec3d::filled(spacing)).cast<float>();
  }
  return cells;
}

/// Of the largest; a type without a material in the scene counts as the largest.
std::vector<float> relative_masses(const Scene& scene, const std::vector<int32_t>& particle_type) {
  std::map<int32_t, double> density;
  double largest = 0;
  for (const auto& [name, material] : scene.materials) {
    density.emplace(particle_type_of(material.model), material.density);
    largest = std::max(largest, material.density);
  }
  std::vector<float> mass;
  mass.reserve(particle_type.size());
  for (const int32_t type : particle_type) {
    const auto found = density.find(type);
    mass.push_back(found == density.end() ? 1.0f : static_cast<float>(found->second / largest));
  }
  return mass;
}

}  // namespace

struct FreeFlight::Impl {
  Impl(Device on, const Scene& scene, const Surroundings& around, const std::vector<int32_t>& particle_type)
      : device(on),
        surroundings(around),
        n(static_cast<int64_t>(particle_type.size())),
        reach(contact_cells * around.normal_spacing),
        parent(on, 0),
        leader(on, 0),
        group(on, particle_type.size()),
        sums(on, particle_type.size()),
        mass(on, 0) {
    const double spacing = group_cells * around.normal_spacing;
    groups.cells = cells_of(around, spacing);
    groups.gravity = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
    const auto cells = static_cast<std::size_t>(groups.cells.count());
    parent.upload(std::vector<int32_t>(cells, -1));
    leader.upload(std::vector<int32_t>(cells, nobody));
    mass.upload(relative_masses(scene, particle_type));
    groups.parent = parent.data();
    groups.leader = leader.data();
    groups.group = group.data();
    groups.sums = sums.data();
    groups.mass = mass.data();
  }

  template <typename Kernel>
  void run(const Kernel& kernel, void* stream) {
    parallel_for_in(stream, device, n, kernel, light);
  }

  Device device;
  const Surroundings& surroundings;
  int64_t n;
  double reach;  ///< [m]
  Groups groups{};
  Buffer<int32_t> parent, leader, group;
  Buffer<GroupSums> sums;
  Buffer<float> mass;
};

FreeFlight::FreeFlight(Device device, const Scene& scene, const Surroundings& surroundings,
                       const std::vector<int32_t>& particle_type)
    : impl_(std::make_unique<Impl>(device, scene, surroundings, particle_type)) {}
FreeFlight::~FreeFlight() = default;

void FreeFlight::find_groups(const Vec3f* before, const Vec3f* now, void* stream) {
  Impl& impl = *impl_;
  Groups& groups = impl.groups;
  groups.before = before;
  groups.now = now;
  const Vec3d reach = Vec3d::filled(impl.reach);
  impl.run(MarkCells{groups}, stream);
  impl.run(JoinCells{groups}, stream);
  impl.run(FindGroup{groups, (impl.surroundings.hold_low + reach).cast<float>(),
                     (impl.surroundings.hold_high - reach).cast<float>()},
           stream);
  const WayFollower way = impl.surroundings.way_follower(impl.device);
  if (way.obstacles.count > 0) impl.run(FindContact{groups, way.obstacles, static_cast<float>(impl.reach)}, stream);
  impl.run(SumPlaces{groups}, stream);
  impl.run(ClearCells{groups}, stream);
}

void FreeFlight::correct(const Vec3f* before, const Vec3f* now, Vec3f* next, void* stream) {
  Impl& impl = *impl_;
  impl.groups.before = before;
  impl.groups.now = now;
  impl.run(SumPushes{impl.groups, next}, stream);
  impl.run(Correct{impl.groups, next}, stream);
}

std::vector<bool> FreeFlight::flying() const {
  const std::vector<GroupSums> sums = impl_->sums.download();
  std::vector<bool> flies;
  for (const int32_t group : impl_->group.download())
    flies.push_back(sums[static_cast<std::size_t>(group)].touches == 0);
  return flies;
}

}  // namespace graupel::graph
