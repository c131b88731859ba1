#include "mpm/cpu_batch.h"

#include <algorithm>
#include <chrono>

#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"

namespace graupel::mpm {

namespace {

class CpuBatch final : public SceneBatch {
 public:
  explicit CpuBatch(const std::vector<PreparedScene>& scenes)
      : device_(scenes.front().options.device), divergence_(scenes.size()) {
    for (const PreparedScene& scene : scenes) runs_.push_back(Simulation::create(scene));
  }

  int scene_count() const override { return static_cast<int>(runs_.size()); }
  const std::vector<int32_t>& particle_type(int scene) const override { return run(scene).particle_type(); }
  void advance_frame() override;
  std::optional<std::string> divergence(int scene) const override {
    return divergence_[static_cast<std::size_t>(scene)];
  }
  std::vector<ParticleFrame> frames(FieldSet wanted) const override {
    std::vector<ParticleFrame> frames;
    for (const auto& run : runs_) frames.push_back(frame_with_fields(*run, wanted));
    return frames;
  }
  RunStatistics statistics() const override;

 private:
  const Simulation& run(int scene) const { return *runs_[static_cast<std::size_t>(scene)]; }
  void advance(std::size_t scene);

  Device device_;
  std::vector<std::unique_ptr<Simulation>> runs_;
  std::vector<std::optional<std::string>> divergence_;
  double seconds_ = 0;
};

void CpuBatch::advance(std::size_t scene) {
  if (divergence_[scene]) return;
  try {
    runs_[scene]->advance_frame();
  } catch (const DivergedError& error) {
    divergence_[scene] = error.what();
  }
}

/// A single scene has all threads; of several each has one, whose kernels then run on that thread alone.
void CpuBatch::advance_frame() {
  const auto begin = std::chrono::steady_clock::now();
  for_each_task(runs_.size(), device_ == Device::cpu ? num_threads() : 1, [this](std::size_t i) { advance(i); });
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
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
