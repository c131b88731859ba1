// The solver for small scenes with equal steps on a GPU: many scenes in one launch, a whole frame in one kernel
// (mpm/gpu/small/small_scene_step.h). All scenes of a launch change during a frame, or none does (small_scene.h). A
// Backend runs the kernel: CUDA's (mpm/gpu/cuda_backend.cuh) or, in tests, fibers.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "core/system/error.h"
#include "mpm/gpu/blocks/batch_lists.h"
#include "mpm/gpu/blocks/batch_setup.h"
#include "mpm/gpu/small/frame_tables.h"
#include "mpm/gpu/small/small_scene.h"
#include "mpm/gpu/small/small_scene_step.h"

namespace graupel::mpm {

/// The contact laws of a scene, in the order of ContactLaw.
inline std::vector<ContactLaw> laws_of(const SceneSetup<float>& s) {
  std::vector<ContactLaw> laws;
  for (const Obstacle& o : s.scene.obstacles) laws.push_back({o.contact, static_cast<float>(o.friction)});
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) laws.push_back({s.walls.contact[axis][side], s.walls.friction[axis][side]});
  laws.push_back({Contact::stick, 0.0f});
  return laws;
}

template <typename Backend>
class SmallSceneSolver {
 public:
  /// Throws ConfigError when a fixed step is too long for a script or an emitter.
  SmallSceneSolver(Backend& backend, std::vector<BatchEntry> entries);

  /// One frame of every scene that has not diverged.
  void advance_frame();
  int scene_count() const { return static_cast<int>(scenes_.size()); }
  const SceneProgress& control(int scene) const { return host_controls_[static_cast<std::size_t>(scene)]; }
  const SceneSetup<float>& setup(int scene) const { return *scenes_[static_cast<std::size_t>(scene)]; }
  /// First place of a scene's particles in frames, and one past the last scene's.
  int64_t first_particle(int scene) const { return first_particle_[static_cast<std::size_t>(scene)]; }
  /// Positions [m] and velocities [m/s] of all scenes, in the order of their sources.
  ParticleFrame frame() const;
  /// State in slot order, which is that of the sources; source_index counts through all scenes. Who is in the run:
  /// setup(scene).lifecycle.
  HostParticles<float> particles() const { return download_particles(particles_); }
  /// The particle arrays, and the scenes' records: what a saved state holds.
  Particles<float>& present_particles() { return particles_; }
  const Buffer<Presence>& presence(int scene) const { return setup(scene).lifecycle.presence(); }
  Buffer<Presence>& presence(int scene) { return scenes_[static_cast<std::size_t>(scene)]->lifecycle.presence(); }
  void set_course(const std::vector<SceneProgress>& controls, int64_t frames_done);
  int64_t memory_bytes() const;
  int64_t active_blocks() const { return 0; }  ///< the grid is kept in full

 private:
  void make_grids();
  void clear_grids();
  void share_out_blocks();
  SmallScene small_scene(int scene) const;
  SmallBatchView view() const;
  template <typename View>
  void run_frame(const View& view);

  Backend& backend_;
  std::vector<std::unique_ptr<SceneSetup<float>>> scenes_;
  std::vector<int64_t> first_particle_;
  std::vector<SceneProgress> host_controls_;
  std::vector<int64_t> first_node_;  ///< of every scene's grid, and one past the last scene's
  int32_t groups_ = 1, blocks_ = 1;  ///< of threads, in a group
  int64_t frames_done_ = 0;

  mutable Particles<float> particles_;
  Buffer<BatchScene> batch_scenes_;
  Buffer<SmallScene> small_scenes_;
  Buffer<SceneProgress> controls_;
  Buffer<StepReport> reports_;
  Buffer<UnitPair> sums_;
  Buffer<NodeContact> contact_;
  std::vector<Buffer<ContactLaw>> laws_;  ///< of every scene
  Buffer<int32_t> base_;
  Buffer<uint32_t> arrivals_;
  std::unique_ptr<FrameTables> tables_;  ///< of scenes that change
};

template <typename Backend>
SmallSceneSolver<Backend>::SmallSceneSolver(Backend& backend, std::vector<BatchEntry> entries)
    : backend_(backend),
      batch_scenes_(backend.device(), 0),
      small_scenes_(backend.device(), 0),
      controls_(backend.device(), 0),
      reports_(backend.device(), 0),
      sums_(backend.device(), 0),
      contact_(backend.device(), 0),
      base_(backend.device(), 0),
      arrivals_(backend.device(), 0) {
  BatchSetup batch = set_up_batch(std::move(entries), backend.device());
  scenes_ = std::move(batch.scenes);
  first_particle_ = batch.first_particle;
  host_controls_ = batch.controls;
  particles_ = upload_particles(batch.particles, backend.device());
  batch_scenes_.upload(batch.records);
  controls_.upload(host_controls_);
  std::vector<StepReport> reports(scenes_.size());
  for (StepReport& report : reports) clear_report(report);
  reports_.upload(reports);
  arrivals_.resize_discard(scenes_.size());
  make_grids();
  share_out_blocks();
  const bool changes = is_changing_scene(setup(0).scene);
  for (const auto& s : scenes_) GRAUPEL_ASSERT(is_changing_scene(s->scene) == changes);
  if (changes) tables_ = std::make_unique<FrameTables>(scenes_, backend_.device());
}

template <typename Backend>
void SmallSceneSolver<Backend>::make_grids() {
  first_node_ = {0};
  for (const auto& s : scenes_)
    first_node_.push_back(first_node_.back() + s->grid.directory_size() * int64_t(nodes_per_block<3>));
  const auto nodes = static_cast<std::size_t>(first_node_.back());
  sums_.resize_discard(3 * 2 * nodes);
  contact_.resize_discard(nodes);
  base_.resize_discard(3 * static_cast<std::size_t>(particles_.count()));
  clear_grids();
  std::vector<SmallScene> small;
  for (int i = 0; i < scene_count(); ++i) {
    laws_.emplace_back(backend_.device(), 0);
    laws_.back().upload(laws_of(setup(i)));
    small.push_back(small_scene(i));
    const int64_t first = first_node_[static_cast<std::size_t>(i)];
    backend_.launch(
        first_node_[static_cast<std::size_t>(i) + 1] - first,
        small::FindContacts{setup(i).view(), small.back().nodes, small.back().first_wall_law, contact_.data() + first});
  }
  small_scenes_.upload(small);
  backend_.wait();
}

template <typename Backend>
void SmallSceneSolver<Backend>::clear_grids() {
  backend_.fill(sums_.data(), 0, sums_.size() * sizeof(UnitPair));
  backend_.fill(base_.data(), 0xff, base_.size() * sizeof(int32_t));
}

/// Units: a sum holds 2^22 of the heaviest particles at one cell a step of the fewest substeps, in steps of 2^-40 of
/// one of them.
template <typename Backend>
SmallScene SmallSceneSolver<Backend>::small_scene(int scene) const {
  const SceneSetup<float>& s = setup(scene);
  auto& self = const_cast<SmallSceneSolver&>(*this);
  SmallScene small{};
  small.first = static_cast<int32_t>(first_particle(scene));
  small.count = static_cast<int32_t>(first_particle(scene + 1)) - small.first;
  for (int d = 0; d < 3; ++d) small.nodes[d] = block_width * s.grid.blocks[d];
  double mass = 0;
  for (const MaterialConfig& m : s.material_configs) mass = std::max(mass, m.density);
  mass *= s.largest_volume;
  const double dt = s.scene.frame_time / static_cast<double>(s.scene.time_step.substeps_per_frame);
  constexpr int digits = 40;
  const auto unit_of = [](double largest) {
    return std::ldexp(1.0f, static_cast<int>(std::ceil(std::log2(largest))) - digits);
  };
  small.mass_unit = unit_of(mass);
  small.momentum_unit = unit_of(mass * s.scene.domain.dx / dt);
  small.per_mass_unit = 1 / small.mass_unit;
  small.per_momentum_unit = 1 / small.momentum_unit;
  const auto place = static_cast<std::size_t>(scene);
  const int64_t nodes = first_node_.back(), first = first_node_[place];
  for (int grid = 0; grid < 3; ++grid) small.sums[grid] = self.sums_.data() + 2 * (grid * nodes + first);
  small.contact = contact_.data() + first;
  small.first_wall_law = static_cast<int32_t>(s.scene.obstacles.size());
  small.laws = laws_[place].data();
  return small;
}

/// One group a scene, as far as there are eight blocks for each, with no more blocks than give every warp four
/// particles.
template <typename Backend>
void SmallSceneSolver<Backend>::share_out_blocks() {
  int64_t most = 0;
  for (int i = 0; i < scene_count(); ++i) most = std::max(most, first_particle(i + 1) - first_particle(i));
  const int64_t per_block = int64_t(backend_.small_warps()) * (warp_width / small::particle_lanes);
  const int at_once = backend_.small_blocks();
  groups_ = std::min(scene_count(), std::max(2, at_once / 8));
  blocks_ = std::min(at_once / groups_, static_cast<int32_t>((most + per_block - 1) / per_block));
}

template <typename Backend>
SmallBatchView SmallSceneSolver<Backend>::view() const {
  auto& self = const_cast<SmallSceneSolver&>(*this);  // as in BatchSolver::view()
  SmallBatchView v{};
  v.scene_count = scene_count();
  v.groups = groups_;
  v.scenes = batch_scenes_.data();
  v.small = small_scenes_.data();
  v.controls = self.controls_.data();
  v.reports = self.reports_.data();
  v.particles = particles_.view();
  v.base = self.base_.data();
  v.arrivals = self.arrivals_.data();
  return v;
}

template <typename Backend>
template <typename View>
void SmallSceneSolver<Backend>::run_frame(const View& v) {
  backend_.segment(0, [&] {
    backend_.launch(scene_count(), small::BeginFrame<View>{v, blocks_});
    backend_.run_frame(v, groups_ * blocks_);
  });
}

template <typename Backend>
void SmallSceneSolver<Backend>::advance_frame() {
  if (tables_) {
    tables_->make(frames_done_, host_controls_);
    if (tables_->upload()) backend_.forget();
    run_frame(ChangingBatchView{view(), tables_->scenes()});
    tables_->make_early(frames_done_ + 1, host_controls_);
  } else {
    run_frame(view());
  }
  ++frames_done_;
  backend_.read(controls_.data(), host_controls_.size(), host_controls_.data(), controls_.data(), 0,
                host_controls_.data());
}

template <typename Backend>
void SmallSceneSolver<Backend>::set_course(const std::vector<SceneProgress>& controls, int64_t frames_done) {
  controls_.upload(controls);
  host_controls_ = controls;
  frames_done_ = frames_done;
  if (tables_) tables_->discard();
  clear_grids();
  backend_.wait();
}

template <typename Backend>
ParticleFrame SmallSceneSolver<Backend>::frame() const {
  Buffer<float> packed(backend_.device(), static_cast<std::size_t>(6 * particles_.count()));
  backend_.launch(particles_.count(),
                  batch::PackParticles{particles_.view(), packed.data(), packed.data() + 3 * particles_.count()});
  backend_.wait();
  return unpack_frame(packed.download());
}

template <typename Backend>
int64_t SmallSceneSolver<Backend>::memory_bytes() const {
  return particles_.bytes() + (tables_ ? tables_->bytes() : 0) +
         static_cast<int64_t>(sums_.size() * sizeof(UnitPair) + contact_.size() * sizeof(NodeContact) +
                              4 * base_.size());
}

}  // namespace graupel::mpm
