#include "graph/corrections/free_flight.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/parallel/buffer.h"
#include "core/parallel/parallel_for.h"
#include "graph/corrections/free_flight_kernels.h"
#include "graph/corrections/free_flight_launch.h"

namespace graupel::graph {

using namespace flight;

namespace {

constexpr Grain light{.items = 1024}, chunks{.items = 16};
constexpr int64_t particles_of_chunk = 64;
constexpr int64_t most_cells = int64_t{1} << 22;
/// Quadratic B-splines: particles and an obstacle touch up to two cells apart. Particles share a node of MPM's grid up
/// to three cells apart, but from two on by less than 1/64 of their weight.
constexpr double group_cells = 2, contact_cells = 2;

FlightCells cells_of(const Environment& environment) {
  FlightCells cells{};
  double spacing = group_cells * environment.normal_spacing;
  for (int64_t count = most_cells + 1; count > most_cells; spacing *= 2) {
    cells.fine = static_cast<float>(spacing / fine_cells);
    cells.inverse_fine = static_cast<float>(fine_cells / spacing);
    count = 1;
    for (int d = 0; d < 3; ++d) {
      const double length = environment.wall_high[d] - environment.wall_low[d];
      cells.size[d] = static_cast<int>(std::ceil(length / spacing)) + 2;
      count *= cells.size[d];
    }
    cells.origin = (environment.wall_low - Vec3d::filled(spacing)).cast<float>();
  }
  return cells;
}

template <typename Body>
void for_chunks(int64_t n, const Body& body) {
  parallel_for_cpu((n + particles_of_chunk - 1) / particles_of_chunk,
                   [&](int64_t c) { body(c * particles_of_chunk, std::min((c + 1) * particles_of_chunk, n)); }, chunks);
}

/// sum_of(slot_of(i)) += terms_of(i) for all i with a slot: neighbours with the same one are added up first.
template <typename SlotOf, typename TermsOf, typename SumOf>
void sum_by_runs(int64_t n, const SlotOf& slot_of, const TermsOf& terms_of, const SumOf& sum_of) {
  for_chunks(n, [&](int64_t begin, int64_t end) {
    decltype(terms_of(0, 0)) sum{};
    int32_t open = -1;
    for (int64_t i = begin; i <= end; ++i) {
      const int32_t slot = i < end ? slot_of(i) : -1;
      if (slot != open) {
        if (open >= 0) add_terms(sum_of(open), sum);
        sum = {};
        open = slot;
      }
      if (slot < 0) continue;
      const auto terms = terms_of(i, slot);
      for (int k = 0; k < terms.size; ++k) sum.value[k] += terms.value[k];
    }
  });
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
  int32_t known = 0;  // particles of a type lie side by side
  float of_known = 0;
  for (const int32_t type : particle_type) {
    if (mass.empty() || type != known) {
      const auto found = density.find(type);
      of_known = found == density.end() ? 1.0f : static_cast<float>(found->second / largest);
      known = type;
    }
    mass.push_back(of_known);
  }
  return mass;
}

/// Joins the node k of a time's list with its lower neighbours.
void join_neighbors(const Groups& groups, int time, int64_t k) {
  const int32_t node = groups.list[time * groups.n + k];
  const uint64_t matter = groups.matter[node];
  Neighbor others[directions];
  for (int direction = 0; direction < directions; ++direction)
    others[direction] = neighbor_of(groups, time, node, step_of(direction));
  uint64_t faces[3];
  for (int d = 0; d < 3; ++d) faces[d] = others[face_direction(d)].matter;
  for (int direction = 0; direction < directions; ++direction) {
    const Vec3i step = step_of(direction);
    const Neighbor& other = others[direction];
    if (any_near(matter, other.matter, step) && !is_spare(step, matter, faces, other.matter))
      groups.unite(node, other.node);
  }
}

/// Joins particle i with what is near to its images beyond periodic walls.
void join_images(const Groups& groups, int time, int64_t i) {
  const Vec3f x = time == 0 ? groups.current[i] : groups.wrapped(groups.ballistic(i));
  const float near = 1.5f * fine_cells * groups.cells.fine;
  Vec3f shift[8] = {Vec3f::zero()};
  int images = 1;
  for (int d = 0; d < 3; ++d) {
    if (!(groups.period[d] > 0)) continue;
    const bool low = x[d]<groups.box_low[d] + near, high = x[d]> groups.box_high[d] - near;
    const int known = images;
    for (int k = 0; (low || high) && k < known; ++k, ++images) {
      shift[images] = shift[k];
      shift[images][d] += low ? groups.period[d] : -groups.period[d];
    }
  }
  const int32_t own = groups.first_node(time) + groups.cells.of(x).cell;
  for (int k = 1; k < images; ++k) {
    const FineCell image = groups.cells.of(x + shift[k]);
    for (int step = 0; step < 27; ++step) {
      const Vec3i to = step_of(step);
      const Neighbor other = neighbor_of(groups, time, groups.first_node(time) + image.cell, to);
      if (any_near(image.bit, other.matter, to)) groups.unite(own, other.node);
    }
  }
}

void find_groups_on_cpu(const Groups& groups) {
  parallel_for_cpu(groups.n, MarkCells{groups}, light);
  for (int time = 0; time < times; ++time)
    parallel_for_cpu(
        groups.listed[time], [&](int64_t k) { join_neighbors(groups, time, k); }, light);
  for (int time = 0; time < times && norm2(groups.period) > 0; ++time)
    parallel_for_cpu(
        groups.n, [&](int64_t i) { join_images(groups, time, i); }, light);
  parallel_for_cpu(
      groups.n, [&](int64_t i) { groups.unite(groups.node_of(0, i), groups.node_of(1, i)); }, light);
  sum_by_runs(
      groups.n, [&](int64_t i) { return place_particle(groups, i); },
      [&](int64_t i, int32_t slot) { return groups.place_terms(i, slot); },
      [&](int32_t slot) -> PlaceTerms& { return groups.sums[slot].place; });
  for (int time = 0; time < times; ++time) {
    for (int64_t k = 0; k < groups.listed[time]; ++k) ClearNode{groups}.clear(time, k);
    groups.listed[time] = 0;
  }
}

void correct_on_cpu(const Groups& groups, Vec3f* next) {
  const auto flying_slot = [&](int64_t i) { return groups.flies(groups.group[i]) ? groups.group[i] : -1; };
  sum_by_runs(
      groups.n, flying_slot, [&](int64_t i, int32_t slot) { return groups.push_terms(i, slot, next); },
      [&](int32_t slot) -> PushTerms& { return groups.sums[slot].push; });
  for_chunks(groups.n, [&](int64_t begin, int64_t end) {
    GroupChange change{};
    int32_t known = -1;
    for (int64_t i = begin; i < end; ++i) {
      const int32_t slot = flying_slot(i);
      if (slot < 0) continue;
      const GroupMomentum& sums = groups.sums[slot];
      if (slot != known) change = change_of(sums.place, sums.push, sums.spans_period != 0);
      known = slot;
      correct(groups, i, slot, change, next);
    }
  });
}

}  // namespace

struct FreeFlight::Impl {
  explicit Impl(Device on) : device(on) {}

  void start(const Scene& scene, const Environment& environment, const std::vector<int32_t>& particle_type,
             void* stream) {
    groups.cells = cells_of(environment);
    const std::size_t nodes = times * static_cast<std::size_t>(groups.cells.count());
    const double contact_distance = contact_cells * environment.normal_spacing;
    groups.gravity = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
    groups.low = (environment.hold_low + Vec3d::filled(contact_distance)).cast<float>();
    groups.high = (environment.hold_high - Vec3d::filled(contact_distance)).cast<float>();
    groups.contact_distance = static_cast<float>(contact_distance);
    groups.obstacles = environment.obstacles.view(device);
    groups.period = environment.period.cast<float>();
    groups.box_low = environment.box_low.cast<float>();
    groups.box_high = environment.box_high.cast<float>();
    matter.resize_discard(nodes);
    parent.resize_discard(nodes);
    counters.resize_discard(times + 1);
    slot.resize_discard(nodes / times);
    groups.matter = matter.data();
    groups.parent = parent.data();
    groups.slot = slot.data();
    groups.listed = counters.data();
    groups.finished = counters.data() + times;
    resize(particle_type.size());
    const std::vector<float> masses = relative_masses(scene, particle_type);
    if (device == Device::cuda) return start_on_gpu(groups, masses, mass.data(), stream);
    parallel_for_cpu(groups.nodes(), ClearAll{groups}, light);
    std::copy(masses.begin(), masses.end(), mass.begin());
  }

  void set_particles(const Scene& scene, const std::vector<int32_t>& particle_type) {
    resize(particle_type.size());
    mass.upload(relative_masses(scene, particle_type));
  }

  void resize(std::size_t n) {
    groups.n = static_cast<int64_t>(n);
    mass.resize_discard(n);
    for (Buffer<int32_t>* of_particles : {&group, &origin}) of_particles->resize_discard(n);
    list.resize_discard(times * n);
    sums.resize_discard(n);
    groups.list = list.data();
    groups.group = group.data();
    groups.origin = origin.data();
    groups.sums = sums.data();
    groups.mass = mass.data();
  }

  Device device;
  Groups groups{};
  Buffer<uint64_t> matter{device, 0};
  Buffer<int32_t> parent{device, 0}, slot{device, 0}, list{device, 0}, counters{device, 0}, group{device, 0},
      origin{device, 0};
  Buffer<GroupMomentum> sums{device, 0};
  Buffer<float> mass{device, 0};
};

FreeFlight::FreeFlight(Device device, const Scene& scene, const Environment& environment,
                       const std::vector<int32_t>& particle_type)
    : impl_(std::make_unique<Impl>(device)) {
  start(scene, environment, particle_type);
}
FreeFlight::~FreeFlight() = default;

void FreeFlight::start(const Scene& scene, const Environment& environment, const std::vector<int32_t>& particle_type,
                       void* stream) {
  impl_->start(scene, environment, particle_type, stream);
}

void FreeFlight::set_particles(const Scene& scene, const std::vector<int32_t>& particle_type) {
  impl_->set_particles(scene, particle_type);
}

void FreeFlight::place(const sparsegrid::ObstacleSetView& obstacles) { impl_->groups.obstacles = obstacles; }

void FreeFlight::find_groups(const Vec3f* before, const Vec3f* current, void* stream) {
  Groups& groups = impl_->groups;
  groups.before = before;
  groups.current = current;
  if (impl_->device == Device::cuda) return find_groups_on_gpu({groups}, stream);
  find_groups_on_cpu(groups);
}

void FreeFlight::correct(const Vec3f* before, const Vec3f* current, Vec3f* next, void* stream) {
  Groups& groups = impl_->groups;
  groups.before = before;
  groups.current = current;
  if (impl_->device == Device::cuda) return correct_on_gpu({{groups, next}}, stream);
  correct_on_cpu(groups, next);
}

void FreeFlight::find_groups_of_all(const std::vector<Frame>& scenes, void* stream) {
  std::vector<Groups> all;
  all.reserve(scenes.size());
  for (const Frame& scene : scenes) all.push_back(scene.groups());
  find_groups_on_gpu(all, stream);
}

void FreeFlight::correct_all(const std::vector<Frame>& scenes, void* stream) {
  std::vector<Correction> all;
  all.reserve(scenes.size());
  for (const Frame& scene : scenes) all.push_back({scene.groups(), scene.next});
  correct_on_gpu(all, stream);
}

const Groups& FreeFlight::Frame::groups() const {
  Groups& groups = flight->impl_->groups;
  groups.before = before;
  groups.current = current;
  return groups;
}

std::vector<int32_t> FreeFlight::groups() const {
  const std::vector<GroupMomentum> sums = impl_->sums.download();
  std::vector<int32_t> groups = impl_->group.download();
  for (int32_t& group : groups)
    if (group >= 0 && sums[static_cast<std::size_t>(group)].touches != 0) group = -1;
  return groups;
}

}  // namespace graupel::graph
