// The tuned solver for GPUs: many scenes in one launch, in single precision (mpm/gpu/blocks/batch_view.h tells the
// layout, mpm/gpu/blocks/batch_kernels.h the kernels). A Backend runs the kernels: CUDA's (mpm/gpu/cuda_backend.cuh)
// or, in tests, fibers.
//
// The host launches whole segments, a sort and some substeps each, without waiting for any of them; the size of every
// step and the end of the frame are decided on the device. It reads one small record a scene and frame. A segment's
// substeps are three kernels each, or, for small scenes with equal steps, all in one (mpm/gpu/blocks/batch_resident.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "mpm/gpu/blocks/batch_kernels.h"
#include "mpm/gpu/blocks/batch_list_owners.h"
#include "mpm/gpu/blocks/batch_resident.h"
#include "mpm/gpu/blocks/batch_setup.h"

namespace graupel::mpm {

template <typename Backend>
class BatchSolver {
 public:
  /// All scenes must have the same grid (size of the domain and dx). Throws ConfigError otherwise.
  BatchSolver(Backend& backend, std::vector<BatchEntry> entries);

  /// One frame of every scene that has not diverged.
  void advance_frame();
  int scene_count() const { return static_cast<int>(scenes_.size()); }
  const SceneProgress& control(int scene) const { return host_controls_[static_cast<std::size_t>(scene)]; }
  const SceneSetup<float>& setup(int scene) const { return *scenes_[static_cast<std::size_t>(scene)]; }
  /// First place of a scene's particles in frames, and one past the last scene's.
  int64_t first_particle(int scene) const { return first_particle_[static_cast<std::size_t>(scene)]; }
  /// Positions [m] and velocities [m/s] of all scenes, in the order of their sources.
  ParticleFrame frame() const;
  /// State in slot order; source_index counts through all scenes.
  HostParticles<float> particles() const;
  /// The arrays in use, and the scenes' records: what a saved state holds.
  Particles<float>& present_particles() { return particles_[counts_.download().front().current]; }
  const Buffer<Presence>& presence(int scene) const { return setup(scene).lifecycle.presence(); }
  Buffer<Presence>& presence(int scene) { return scenes_[static_cast<std::size_t>(scene)]->lifecycle.presence(); }
  void set_course(const std::vector<SceneProgress>& controls, int64_t /*frames_done*/) {
    controls_.upload(controls);
    host_controls_ = controls;
  }
  int64_t memory_bytes() const;
  int64_t active_blocks() const { return active_blocks_; }

 private:
  BatchView view() const;
  void reserve(int64_t owners, int64_t nodes);
  void sort(const BatchView& v, bool resident);
  void segment(int substeps);
  int substeps_until_sort() const;
  int64_t segments_left(int substeps) const;
  bool is_resident() const;
  bool read_back();
  void grow();

  Backend& backend_;
  std::vector<std::unique_ptr<SceneSetup<float>>> scenes_;
  std::vector<int64_t> first_particle_;
  int64_t count_ = 0;
  int32_t directory_ = 0;
  std::vector<SceneProgress> host_controls_;
  int64_t active_blocks_ = 0;

  mutable Particles<float> particles_[2];
  std::vector<BatchScene> host_scenes_;
  bool equal_steps_ = true;
  int64_t owner_capacity_ = 0;
  Buffer<BatchScene> batch_scenes_;
  Buffer<SceneProgress> controls_;
  Buffer<StepReport> reports_;
  Buffer<BlockCounts> counts_;
  Buffer<OwnerBlock> owners_;
  Buffer<int32_t> start_, owner_of_key_, node_key_, node_of_key_, slots_, sorted_slots_;
  Buffer<uint32_t> keys_, sorted_keys_, arrivals_;
  Buffer<uint8_t> node_flag_, head_;
  Buffer<NodeSum> arenas_, nodes_;
};

template <typename Backend>
BatchSolver<Backend>::BatchSolver(Backend& backend, std::vector<BatchEntry> entries) : backend_(backend) {
  const Device device = backend.device();
  BatchSetup batch = set_up_batch(std::move(entries), device);
  scenes_ = std::move(batch.scenes);
  first_particle_ = batch.first_particle;
  host_scenes_ = batch.records;
  host_controls_ = batch.controls;
  count_ = first_particle_.back();
  for (const auto& s : scenes_) {
    const Domain &first = scenes_.front()->scene.domain, &domain = s->scene.domain;
    if (domain.dx != first.dx || !(domain.size == first.size))
      throw ConfigError("scenes of one batch must have the same grid (domain.size and domain.dx)");
    equal_steps_ = equal_steps_ && s->scene.time_step.policy != StepPolicy::adaptive;
  }
  const double directory =
      static_cast<double>(scenes_.front()->view().grid.directory_size()) * static_cast<double>(scenes_.size());
  if (directory >= double(1 << 26) || count_ > 0x7ffffff0)
    throw ConfigError("the batch is too large (" + std::to_string(static_cast<int64_t>(directory)) +
                      " grid blocks, allowed: 67108863, and " + std::to_string(count_) +
                      " particles, allowed: 2147483632). Use fewer scenes, a larger dx or a smaller domain");
  directory_ = static_cast<int32_t>(scenes_.front()->view().grid.directory_size());
  const auto n = static_cast<std::size_t>(count_);
  const auto keys = static_cast<std::size_t>(directory_) * scenes_.size(), owners = std::min(n, keys);
  particles_[0] = upload_particles(batch.particles, device);
  particles_[1] = Particles<float>(device, count_);
  batch_scenes_ = Buffer<BatchScene>(device, 0);
  batch_scenes_.upload(host_scenes_);
  controls_ = Buffer<SceneProgress>(device, 0);
  controls_.upload(host_controls_);
  std::vector<StepReport> reports(scenes_.size());
  for (StepReport& report : reports) clear_report(report);
  reports_ = Buffer<StepReport>(device, 0);
  reports_.upload(reports);
  counts_ = Buffer<BlockCounts>(device, 0);
  counts_.upload({BlockCounts{}});
  owners_ = Buffer<OwnerBlock>(device, owners);
  start_ = Buffer<int32_t>(device, owners + 1);
  owner_of_key_ = Buffer<int32_t>(device, keys);
  node_key_ = Buffer<int32_t>(device, keys);
  node_of_key_ = Buffer<int32_t>(device, keys);
  node_flag_ = Buffer<uint8_t>(device, keys);
  slots_ = Buffer<int32_t>(device, n);
  sorted_slots_ = Buffer<int32_t>(device, n);
  keys_ = Buffer<uint32_t>(device, n);
  sorted_keys_ = Buffer<uint32_t>(device, n);
  head_ = Buffer<uint8_t>(device, n);
  arrivals_ = Buffer<uint32_t>(device, scenes_.size());
  arenas_ = Buffer<NodeSum>(device, 0);
  nodes_ = Buffer<NodeSum>(device, 0);
  backend_.reserve(count_, static_cast<int64_t>(keys));
  reserve(64, 64);
}

template <typename Backend>
void BatchSolver<Backend>::reserve(int64_t owners, int64_t nodes) {
  const auto keys = static_cast<int64_t>(node_key_.size());
  owners = std::min({owners, keys, count_});
  nodes = std::min(nodes, keys);
  constexpr int64_t most_nodes = 0x7fffffff / nodes_per_block<3>;  // a node's place is a 32-bit number
  if (nodes > most_nodes)
    throw ConfigError("the particles spread over too many grid blocks (" + std::to_string(nodes) +
                      ", allowed: " + std::to_string(most_nodes) + "). Use fewer scenes, a larger dx or less material");
  owner_capacity_ = owners;
  arenas_.resize_discard(
      static_cast<std::size_t>(std::max<int64_t>(owners, 2 * backend_.resident_blocks()) * halo_nodes));
  nodes_.resize_discard(static_cast<std::size_t>(nodes * nodes_per_block<3>));
  backend_.forget();
}

template <typename Backend>
BatchView BatchSolver<Backend>::view() const {
  auto& self =
      const_cast<BatchSolver&>(*this);  // views give kernels access to the arrays; const members only read them
  BatchView v{};
  v.scene_count = scene_count();
  v.directory = directory_;
  v.particle_count = static_cast<int32_t>(count_);
  v.owner_capacity = static_cast<int32_t>(owner_capacity_);
  v.node_capacity = static_cast<int32_t>(nodes_.size() / nodes_per_block<3>);
  v.scenes = batch_scenes_.data();
  v.controls = self.controls_.data();
  v.reports = self.reports_.data();
  for (int i = 0; i < 2; ++i) v.particles[i] = particles_[i].view();
  v.counts = self.counts_.data();
  v.owners = self.owners_.data();
  v.start = self.start_.data();
  v.owner_of_key = self.owner_of_key_.data();
  v.node_key = self.node_key_.data();
  v.node_of_key = self.node_of_key_.data();
  v.node_flag = self.node_flag_.data();
  v.arrivals = self.arrivals_.data();
  v.sort_key = self.sorted_keys_.data();
  v.arenas = self.arenas_.data();
  v.nodes = self.nodes_.data();
  return v;
}

/// Particles by block and cell; owner blocks with their particles; node blocks, unless a segment is one kernel.
template <typename Backend>
void BatchSolver<Backend>::sort(const BatchView& v, bool resident) {
  using namespace batch;
  const auto keys = static_cast<int64_t>(node_flag_.size());
  backend_.launch(count_, WriteSortKeys{v, keys_.data(), slots_.data()});
  backend_.sort_pairs(keys_.data(), sorted_keys_.data(), slots_.data(), sorted_slots_.data(), count_,
                      static_cast<uint64_t>(keys) * cells_per_block);
  backend_.launch(count_, PermuteBatch{v, sorted_slots_.data()});
  backend_.fill(owner_of_key_.data(), 0xff, owner_of_key_.size() * sizeof(int32_t));
  if (resident) return backend_.list_owners(v);
  backend_.launch(v.scene_count, SwapBatch{v});
  backend_.launch(count_, MarkHeads{v.sort_key, head_.data()});
  backend_.select_marked(head_.data(), count_, v.start, &counts_.data()->owner);
  backend_.fill(node_flag_.data(), 0, node_flag_.size());
  backend_.fill(node_of_key_.data(), 0xff, node_of_key_.size() * sizeof(int32_t));
  backend_.launch(static_cast<int64_t>(owners_.size()),
                  NameOwners<typename Backend::Atomics>{v, typename Backend::Atomics{}});
  backend_.select_marked(node_flag_.data(), keys, v.node_key, &counts_.data()->node);
  backend_.launch(keys, NameNodes{v});
  backend_.launch(v.scene_count, ResumeScenes{v});
}

/// Whether all owner blocks can be on the GPU at once and no step waits for a step_statistics of the whole scene.
/// Before the first sort nothing is known: then it is tried, and does nothing if not.
template <typename Backend>
bool BatchSolver<Backend>::is_resident() const {
  return equal_steps_ && active_blocks_ <= backend_.resident_blocks();
}

/// Substeps of a segment after which scenes are due for a sort together.
template <typename Backend>
int BatchSolver<Backend>::substeps_until_sort() const {
  int substeps = 0;
  for (const SceneProgress& c : host_controls_)
    if (c.phase == ScenePhase::unsorted) substeps = std::gcd(substeps, c.sort_interval);
  return std::max(substeps, shortest_interval);
}

template <typename Backend>
void BatchSolver<Backend>::segment(int substeps) {
  const BatchView v = view();
  const bool resident = is_resident();
  backend_.segment(resident ? 0 : substeps, [&] {
    sort(v, resident);
    if (resident) return backend_.run_segment(v);
    for (int i = 0; i < substeps; ++i) {
      backend_.particle_to_grid(v);
      backend_.update_grid(v);
      backend_.grid_to_particle(v);
    }
  });
}

/// Segments that the slowest scene needs for the rest of its frame, from its present step.
template <typename Backend>
int64_t BatchSolver<Backend>::segments_left(int substeps) const {
  int64_t most = 0;
  for (int i = 0; i < scene_count(); ++i) {
    const SceneProgress& c = control(i);
    if (c.phase != ScenePhase::running && c.phase != ScenePhase::unsorted) continue;
    const SceneSetup<float>& s = setup(i);
    const int64_t steps = s.scene.time_step.policy != StepPolicy::adaptive
                              ? c.equal_substeps - c.frame_substeps
                              : static_cast<int64_t>(std::ceil((s.scene.frame_time - c.elapsed) / double(c.dt)));
    most = std::max(most, (steps + substeps - 1) / substeps);
  }
  return std::min<int64_t>(most, 256);
}

/// Reads the records of all scenes; returns whether storage overflowed.
template <typename Backend>
bool BatchSolver<Backend>::read_back() {
  BlockCounts counts;
  backend_.read(controls_.data(), host_controls_.size(), host_controls_.data(), counts_.data(), 1, &counts);
  active_blocks_ = counts.owner;
  return counts.overflow != 0;
}

template <typename Backend>
void BatchSolver<Backend>::grow() {
  const BlockCounts counts = counts_.download().front();
  reserve(counts.owner + counts.owner / 4 + 16, counts.node + counts.node / 4 + 64);
}

template <typename Backend>
void BatchSolver<Backend>::advance_frame() {
  backend_.launch(scene_count(), batch::BeginFrame{view()});
  for (std::size_t i = 0; i < host_scenes_.size(); ++i) begin_frame(host_scenes_[i], host_controls_[i]);
  const int substeps = substeps_until_sort();
  while (const int64_t segments = segments_left(substeps)) {
    for (int64_t i = 0; i < segments; ++i) segment(substeps);
    if (read_back()) grow();
  }
}

template <typename Backend>
ParticleFrame BatchSolver<Backend>::frame() const {
  Buffer<float> packed(backend_.device(), static_cast<std::size_t>(6 * count_));
  backend_.launch(count_, batch::PackFrame{view(), packed.data(), packed.data() + 3 * count_});
  backend_.wait();
  return unpack_frame(packed.download());
}

template <typename Backend>
HostParticles<float> BatchSolver<Backend>::particles() const {
  return download_particles(particles_[counts_.download().front().current]);
}

template <typename Backend>
int64_t BatchSolver<Backend>::memory_bytes() const {
  return particles_[0].bytes() + particles_[1].bytes() +
         static_cast<int64_t>((arenas_.size() + nodes_.size()) * sizeof(NodeSum) + 17 * keys_.size() +
                              13 * node_key_.size());
}

}  // namespace graupel::mpm
