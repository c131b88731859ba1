// Saving and restoring a solver, bit for bit: where the run is, particle arrays
// in slot order, who is present, who carries loads. All else follows from these and the scene:
// every frame starts with a sort, scripts and moving obstacles depend on time
// alone.
#include <cmath>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "mpm/particles/state_bytes.h"
#include "mpm/particles/state_check.h"
#include "mpm/scene/scene_hash.h"
#include "mpm/solver/solver.h"

namespace graupel::mpm {

namespace {

struct Course {
  int64_t frames_done;
  double frame_elapsed;
  StepStatistics step_statistics;
  RunStatistics statistics;
};

SolverKind solver_kind(const SimulationOptions& options, InstructionSet set) {
  if (options.device != Device::cpu) return SolverKind::gpu_portable;
  if (options.kernels == Kernels::portable) return SolverKind::cpu_portable;
  if (set == InstructionSet::avx512) return SolverKind::cpu_avx512;
  return set == InstructionSet::avx2 ? SolverKind::cpu_avx2 : SolverKind::cpu_baseline;
}

/// Throws InputError for what no run leaves: a state with the right sums may still hold anything.
void check_course(const Course& course, double frame_time) {
  if (course.frames_done < 0 || !(course.frame_elapsed >= 0 && course.frame_elapsed <= frame_time))
    throw InputError("the saved state is damaged (frame " + std::to_string(course.frames_done) + ", " +
                     std::to_string(course.frame_elapsed) + " s of it done). Use an older one, or run again");
}

}  // namespace

template <typename T>
StateOwner Solver<T>::state_owner() const {
  uint64_t scene = scene_hash(scene_, options_.seed);
  for (std::size_t m = 0; m < user_laws_.size(); ++m)
    if (user_laws_[m]) scene = fnv1a(scene, &m, sizeof(m));
  return {scene, solver_kind(options_, grid_.instruction_set), sizeof(T), static_cast<int64_t>(particle_count())};
}

template <typename T>
std::size_t Solver<T>::state_bytes() const {
  std::size_t content = sizeof(Course) + grid_.lifecycle.presence().size() * sizeof(Presence);
  particles_.for_each_buffer([&](const auto& buffer) { content += buffer.size() * sizeof(*buffer.data()); });
  return content + loads_.state_bytes();
}

template <typename T>
std::vector<std::byte> Solver<T>::save_state() const {
  StateWriter writer(state_owner(), state_bytes());
  Course course{frames_done_, frame_elapsed_, step_statistics_, statistics_};
  course.statistics.solver_seconds = 0;
  writer.add(course);
  particles_.for_each_buffer([&](const auto& buffer) { writer.add(buffer); });
  writer.add(grid_.lifecycle.presence());
  loads_.save(writer);
  return writer.finish();
}

template <typename T>
void Solver<T>::load_state(const std::vector<std::byte>& state) {
  StateReader reader(state, state_owner(), state_bytes());
  Course course;
  reader.get(course);
  particles_.for_each_buffer([&](auto& buffer) { reader.get(buffer); });
  reader.get(grid_.lifecycle.presence());
  loads_.load(reader);
  check_course(course, scene_.frame_time);
  loads_.check_state();
  if (!particles_.spare_lanes_are_clear())
    throw InputError("the saved state is damaged (indices behind the last particle). Use an older one, or run again");
  check_state(download_particles(particles_), grid_.lifecycle.presence().download(),
              static_cast<int32_t>(scene_.materials.size()), scene_.domain);
  const double seconds = statistics_.solver_seconds;
  frames_done_ = course.frames_done;
  frame_elapsed_ = course.frame_elapsed;
  in_frame_ = false;
  step_statistics_ = course.step_statistics;
  statistics_ = course.statistics;
  statistics_.solver_seconds = seconds;
  find_owner_blocks(view());
  grid_.blocks.invalidate();
  if (contacts_) contacts_->begin_frame();
}

template StateOwner Solver<float>::state_owner() const;
template StateOwner Solver<double>::state_owner() const;
template std::size_t Solver<float>::state_bytes() const;
template std::size_t Solver<double>::state_bytes() const;
template std::vector<std::byte> Solver<float>::save_state() const;
template std::vector<std::byte> Solver<double>::save_state() const;
template void Solver<float>::load_state(const std::vector<std::byte>&);
template void Solver<double>::load_state(const std::vector<std::byte>&);

}  // namespace graupel::mpm
