#include "graph/cuda/rollout/bundle_poses.h"

#include <algorithm>

namespace graupel::graph {

template <typename T>
void BundlePoses::Poses<T>::upload(void* stream) {
  const std::size_t bytes = device.size() * sizeof(T);
  if (bytes == 0) return;
  GRAUPEL_CUDA_CHECK(
      cudaMemcpyAsync(device.data(), host.data(), bytes, cudaMemcpyHostToDevice, static_cast<cudaStream_t>(stream)));
}

void BundlePoses::start(const Environment& environment, int64_t frames) {
  environment_ = &environment;
  frames_ = static_cast<std::size_t>(frames);
  if (!any()) {
    environment.view(Device::cuda);
    return;
  }
  const EnvironmentPose pose = environment.pose_at(0, Device::cuda);
  obstacles_.start(pose.obstacles.size(), frames_);
  carried_from_.start(pose.carried_from.size(), frames_);
  normals_.start(pose.normals.size(), frames_);
  ways_.start(pose.obstacles.size(), frames_);
  way_count_.start(1, frames_);
  environment_->view_of_pose(Device::cuda, {obstacles_.of(0), carried_from_.of(0), normals_.of(0)});
}

void BundlePoses::place(double time, void* stream) {
  if (!any()) return;
  double before = time;
  for (std::size_t frame = 0; frame < frames_; ++frame) {
    const double now = time + static_cast<double>(frame + 1) * environment_->frame_time;
    const EnvironmentPose pose = environment_->pose_at(now, Device::cuda);
    obstacles_.set(frame, pose.obstacles);
    carried_from_.set(frame, pose.carried_from);
    normals_.set(frame, pose.normals);
    const std::vector<ObstacleWay> ways = environment_->ways_between(before, now);
    ways_.set(frame, ways);
    way_count_.set(frame, {static_cast<int32_t>(ways.size())});
    before = now;
  }
  obstacles_.upload(stream);
  carried_from_.upload(stream);
  normals_.upload(stream);
  ways_.upload(stream);
  way_count_.upload(stream);
}

EnvironmentView BundlePoses::environment(int64_t frame) const {
  if (!any()) return environment_->view(Device::cuda);
  return environment_->view_of_pose(Device::cuda, {obstacles_.of(frame), carried_from_.of(frame), normals_.of(frame)});
}

SweptCollision BundlePoses::swept_collision(int64_t frame) const {
  SweptCollision way = environment_->swept_collision(Device::cuda);
  if (any()) way.obstacles.obstacles = obstacles_.of(frame);
  return way;
}

CarrierView BundlePoses::carriers(int64_t frame) const {
  if (!any()) return {};
  return {ways_.of(frame), way_count_.of(frame)};
}

}  // namespace graupel::graph
