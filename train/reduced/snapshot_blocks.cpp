#include "train/reduced/snapshot_blocks.h"

#include <algorithm>
#include <cstring>

#include "core/system/stopwatch.h"

namespace graupel::train {

SnapshotMatrix EveryNthBlocks::load(int block) {
  const SnapshotMatrix all = all_.load(block);
  chosen_.resize(snapshots(), all.cols());
  for (Eigen::Index i = 0; i < chosen_.rows(); ++i) chosen_.row(i) = all.row(i * n_);
  return {chosen_.data(), chosen_.rows(), chosen_.cols()};
}

FieldBlocks::FieldBlocks(const SnapshotSet& set, SnapshotField field, const rom::Clusters* clusters, double most_bytes)
    : set_(set),
      field_(field),
      clusters_(clusters),
      points_(clusters ? clusters->count : set.particles()),
      components_(components_of(field)) {
  const int64_t piece_points = piece / components_;
  const double piece_bytes = static_cast<double>(set.snapshots() * piece) * sizeof(float);
  const auto pieces = static_cast<int64_t>(std::clamp(most_bytes / piece_bytes, 1.0, 1e12));
  block_points_ = std::min(pieces * piece_points, points_);
  if (!clusters) return;
  members_.assign(static_cast<std::size_t>(points_), 0);
  for (const int32_t c : clusters->of_particle) members_[static_cast<std::size_t>(c)] += 1;
}

SnapshotMatrix FieldBlocks::load(int block) {
  const auto first = static_cast<std::size_t>(block * block_points_);
  const std::size_t count =
      std::min(static_cast<std::size_t>(block_points_), static_cast<std::size_t>(points_) - first);
  const auto width = static_cast<std::size_t>(components_), row = count * width;
  const auto as_matrix = [&] { return SnapshotMatrix(values_.data(), snapshots(), static_cast<Eigen::Index>(row)); };
  if (block == loaded_) return as_matrix();
  const Stopwatch watch;
  loaded_ = -1;
  values_.assign(static_cast<std::size_t>(snapshots()) * row, 0);
  const auto copy = [&](int64_t snapshot, const float* from) {
    std::memcpy(values_.data() + static_cast<std::size_t>(snapshot) * row, from + first * width, row * sizeof(float));
  };
  const auto average = [&](int64_t snapshot, const float* from) {
    float* to = values_.data() + static_cast<std::size_t>(snapshot) * row;
    for (const int32_t cluster : clusters_->of_particle) {
      const auto c = static_cast<std::size_t>(cluster);
      if (c - first < count)  // wraps below the block
        for (std::size_t k = 0; k < width; ++k) to[(c - first) * width + k] += from[k] / members_[c];
      from += width;
    }
  };
  if (clusters_)
    set_.visit(field_, average);
  else
    set_.visit(field_, copy);
  loaded_ = block;
  seconds_ += watch.seconds();
  return as_matrix();
}

}  // namespace graupel::train
