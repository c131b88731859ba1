#include "mpm/grouped_batch.h"

#include <algorithm>
#include <utility>

namespace graupel::mpm {

namespace {

class GroupedBatch final : public SceneBatch {
 public:
  GroupedBatch(std::vector<std::unique_ptr<SceneBatch>> batches, const SceneGroups& groups)
      : batches_(std::move(batches)) {
    for (std::size_t g = 0; g < groups.size(); ++g)
      for (std::size_t i = 0; i < groups[g].size(); ++i) {
        slots_.resize(std::max(slots_.size(), groups[g][i] + 1));
        slots_[groups[g][i]] = {g, static_cast<int>(i)};
      }
  }

  int scene_count() const override { return static_cast<int>(slots_.size()); }
  const std::vector<int32_t>& particle_type(int scene) const override {
    return batch(scene).particle_type(slot(scene).index);
  }
  bool advance_frame(const std::function<bool()>& stop) override {
    for (; next_ < batches_.size(); ++next_)
      if (stop() || !batches_[next_]->advance_frame(stop)) return false;
    next_ = 0;
    return true;
  }
  std::optional<std::string> divergence(int scene) const override { return batch(scene).divergence(slot(scene).index); }
  std::vector<ParticleFrame> frames(FieldSet wanted) const override {
    std::vector<std::vector<ParticleFrame>> of_groups;
    for (const auto& batch : batches_) of_groups.push_back(batch->frames(wanted));
    std::vector<ParticleFrame> frames;
    for (const Slot& slot : slots_)
      frames.push_back(std::move(of_groups[slot.group][static_cast<std::size_t>(slot.index)]));
    return frames;
  }
  std::vector<std::shared_ptr<const float>> rows(ParticleQuantity what) const override {
    std::vector<std::shared_ptr<const float>> rows(slots_.size());
    std::vector<std::vector<std::shared_ptr<const float>>> of_groups;
    for (const auto& batch : batches_) of_groups.push_back(batch->rows(what));
    for (std::size_t i = 0; i < slots_.size(); ++i)
      rows[i] = of_groups[slots_[i].group][static_cast<std::size_t>(slots_[i].index)];
    return rows;
  }
  RunStatistics statistics() const override {
    RunStatistics all;
    for (const auto& batch : batches_) {
      const RunStatistics one = batch->statistics();
      all.substeps = std::max(all.substeps, one.substeps);
      all.active_blocks += one.active_blocks;
      all.peak_bytes += one.peak_bytes;
      all.loads_without_carriers += one.loads_without_carriers;
      all.solver_seconds += one.solver_seconds;
    }
    return all;
  }

 private:
  /// Where a scene is.
  struct Slot {
    std::size_t group = 0;
    int index = 0;
  };
  const Slot& slot(int scene) const { return slots_[static_cast<std::size_t>(scene)]; }
  const SceneBatch& batch(int scene) const { return *batches_[slot(scene).group]; }

  std::vector<std::unique_ptr<SceneBatch>> batches_;
  std::vector<Slot> slots_;
  std::size_t next_ = 0;  ///< batch with part of the frame still to make
};

}  // namespace

std::unique_ptr<SceneBatch> join_groups(std::vector<std::unique_ptr<SceneBatch>> batches, const SceneGroups& groups) {
  return std::make_unique<GroupedBatch>(std::move(batches), groups);
}

}  // namespace graupel::mpm
