// The joins that run on a GPU, with threads for lanes: they find the groups that a CPU finds.
#include "graph/corrections/free_flight_joins.h"

#include <gtest/gtest.h>

#include <barrier>
#include <thread>

#include "graph/corrections/free_flight.h"
#include "tests/graph/corrections/flight_cases.h"

namespace graupel::graph {
namespace {

using namespace flight;

/// What the lanes of a warp share.
struct WarpMemory {
  std::barrier<> meeting{32};
  uint64_t values[32] = {};
};

class ThreadWarp {
 public:
  ThreadWarp(WarpMemory& memory, int lane) : memory_(memory), lane_(lane) {}
  int lane() const { return lane_; }
  unsigned ballot(bool here) const {
    unsigned lanes = 0;
    exchange(here ? 1 : 0, [&] {
      for (unsigned k = 0; k < 32; ++k) lanes |= static_cast<unsigned>(memory_.values[k]) << k;
    });
    return lanes;
  }
  template <typename T>
  T shuffle(T value, int lane) const {
    T seen{};
    exchange(static_cast<uint64_t>(value), [&] { seen = static_cast<T>(memory_.values[lane]); });
    return seen;
  }

 private:
  template <typename Look>
  void exchange(uint64_t value, const Look& look) const {
    memory_.values[lane_] = value;
    memory_.meeting.arrive_and_wait();
    look();
    memory_.meeting.arrive_and_wait();
  }
  WarpMemory& memory_;
  int lane_;
};

/// The arrays of a frame, without obstacles, as FreeFlight has them.
struct Arrays {
  Arrays(const Scene& scene, const Frame& frame) {
    const double spacing = 2 * scene.domain.dx, contact_distance = 2 * scene.domain.dx;
    groups.cells.fine = static_cast<float>(spacing / fine_cells);
    groups.cells.inverse_fine = static_cast<float>(fine_cells / spacing);
    groups.cells.origin = Vec3f::filled(static_cast<float>(-spacing));
    groups.cells.size = {34, 34, 34};
    groups.gravity = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
    groups.low = (scene.wall_low() + Vec3d::filled(contact_distance)).cast<float>();
    groups.high = (scene.wall_high() - Vec3d::filled(contact_distance)).cast<float>();
    const std::size_t n = frame.current.size(), cells = static_cast<std::size_t>(groups.cells.count());
    groups.n = static_cast<int64_t>(n);
    matter.assign(times * cells, 0);
    parent.assign(times * cells, nobody);
    parent[ground] = ground;
    slot.resize(cells);
    for (auto* array : {&group, &origin}) array->resize(n);
    list.resize(times * n);
    listed.assign(times, 0);
    sums.resize(n);
    groups.matter = matter.data();
    groups.parent = parent.data();
    groups.slot = slot.data();
    groups.list = list.data();
    groups.listed = listed.data();
    groups.group = group.data();
    groups.origin = origin.data();
    groups.sums = sums.data();
    groups.before = frame.before.data();
    groups.current = frame.current.data();
  }
  Groups groups{};
  std::vector<uint64_t> matter;
  std::vector<int32_t> parent, slot, group, origin, list, listed;
  std::vector<GroupMomentum> sums;
};

/// Two warps take the items in turns, as the kernel's do.
void join_by_warps(const Groups& groups) {
  constexpr int warps = 2;
  WarpMemory memory[warps];
  std::vector<std::thread> lanes;
  for (int k = 0; k < 32 * warps; ++k)
    lanes.emplace_back([&, k] {
      const ThreadWarp warp(memory[k / 32], k % 32);
      for (int time = 0; time < times; ++time) {
        const int64_t items = int64_t{groups.listed[time]} * lanes_of_node;
        for (int64_t item = k; item < (items + 31) / 32 * 32; item += 32 * warps)
          join_neighbors(warp, groups, time, item < items ? item : -1);
      }
      for (int64_t i = k; i < (groups.n + 31) / 32 * 32; i += 32 * warps) join_times(warp, groups, i);
    });
  for (std::thread& lane : lanes) lane.join();
}

TEST(FreeFlightJoins, WarpsFindTheGroupsOfTheCpu) {
  const Scene scene = box_scene();
  const Environment environment(scene);
  for (const Frame& frame : {crowd(scene), snake(scene, 2000)}) {
    FreeFlight flight(Device::cpu, scene, environment, frame.type);
    flight.find_groups(frame.before.data(), frame.current.data());
    const std::vector<int32_t> expected = flight.groups();
    Arrays arrays(scene, frame);
    for (int64_t i = 0; i < arrays.groups.n; ++i) MarkCells{arrays.groups}(i);
    join_by_warps(arrays.groups);
    std::vector<int32_t> found;
    for (int64_t i = 0; i < arrays.groups.n; ++i) {
      const int32_t root = arrays.groups.root(arrays.groups.node_of(0, i));
      found.push_back(root == ground ? -1 : root);
    }
    EXPECT_TRUE(same_groups(found, expected));
  }
}

}  // namespace
}  // namespace graupel::graph
