#include "mpm/cpu_batch.h"

#include <algorithm>
#include <chrono>

#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "core/system/stop_signal.h"

namespace graupel::mpm {

namespace {

class CpuBatch final : public SceneBatch {
 public:
  explicit CpuBatch(const std::vector<PreparedScene>& scenes)
      : device_(scenes.front().options.device), divergence_(scenes.size()), in_frame_(scenes.size()) {
    for (const PreparedScene& scene : scenes) runs_.push_back(Simulation::create(scene));
  }

  int scene_count() const override { return static_cast<int>(runs_.size()); }
  const std::vector<int32_t>& particle_type(int scene) const override { return run(scene).particle_type(); }
  bool advance_frame(const std::function<bool()>& stop) override;
  std::optional<std::string> divergence(int scene) const override {
    return divergence_[static_cast<std::size_t>(scene)];
  }
  std::vector<ParticleFrame> frames(FieldSet wanted) const override {
    std::vector<ParticleFrame> frames;
    for (const auto& run : runs_) frames.push_back(frame_with_fields(*run, wanted));
    return frames;
  }
  std::vector<std::shared_ptr<const float>> rows(ParticleQuantity what) const override {
    std::vector<std::shared_ptr<const float>> rows;
    for (const auto& run : runs_) rows.push_back(run->rows(what));
    return rows;
  }
  RunStatistics statistics() const override;

 private:
  const Simulation& run(int scene) const { return *runs_[static_cast<std::size_t>(scene)]; }
  void advance(std::size_t scene, const std::function<bool()>& stop);

  Device device_;
  std::vector<std::unique_ptr<Simulation>> runs_;
  std::vector<std::optional<std::string>> divergence_;
  std::vector<uint8_t> in_frame_;  ///< has part of the frame still to make
  double seconds_ = 0;
};

/// The rest of the present frame.
void CpuBatch::advance(std::size_t scene, const std::function<bool()>& stop) {
  if (divergence_[scene]) in_frame_[scene] = 0;
  try {
    while (in_frame_[scene] && !stop()) {
      in_frame_[scene] = !runs_[scene]->advance_substep();
      if (in_frame_[scene]) give_up_if_stopped();
    }
  } catch (const DivergedError& error) {
    divergence_[scene] = error.what();
    in_frame_[scene] = 0;
  }
}

/// A single scene has all threads; of several each has one, whose kernels then run on that thread alone.
bool CpuBatch::advance_frame(const std::function<bool()>& stop) {
  const auto begin = std::chrono::steady_clock::now();
  const auto unfinished = [](uint8_t scene) { return scene != 0; };
  if (std::none_of(in_frame_.begin(), in_frame_.end(), unfinished)) std::fill(in_frame_.begin(), in_frame_.end(), 1);
  for_each_task(runs_.size(), device_ == Device::cpu ? num_threads() : 1, [&](std::size_t i) { advance(i, stop); });
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return std::none_of(in_frame_.begin(), in_frame_.end(), unfinished);
}

RunStatistics CpuBatch::statistics() const {
  RunStatistics all;
  for (const auto& run : runs_) {
    const RunStatistics one = run->statistics();
    all.substeps = std::max(all.substeps, one.substeps);
    all.active_blocks += one.active_blocks;
    all.peak_bytes += one.peak_bytes;
    all.loads_without_carriers += one.loads_without_carriers;
  }
  all.solver_seconds = seconds_;
  return all;
}

}  // namespace

std::unique_ptr<SceneBatch> make_side_by_side(const std::vector<PreparedScene>& scenes) {
  return std::make_unique<CpuBatch>(scenes);
}

}  // namespace graupel::mpm
