// Runs the kernels of a reduced-order model's step on the CPU, with fibers for threads.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <vector>

#include "rom/cuda/device_run.h"
#include "tests/fiber_block.h"

namespace graupel::rom::device {

class FiberBackend {
 public:
  Device device() const { return Device::cpu; }
  int processors() const { return 1; }
  void wait() {}
  template <typename Body>
  void launch(int64_t n, const Body& body) {
    for (int64_t i = 0; i < n; ++i) body(i);
  }
  void branch(const RunView& view) {
    has_many_instances(view) ? branch_by<ManyOutputs>(view) : branch_by<OneOutput>(view);
  }
  void decode(const RunView& view) {
    DecodeShared shared;
    std::vector<double> room = equation_room(view);
    run(view.instance_count * (1 + view.decode_blocks), shared,
        [&](const FiberThread& thread) { device::decode(thread, view, shared, room.data()); });
  }
  void gather(const RunView& view) {
    GatherShared shared;
    run(view.instance_count * view.gather_blocks, shared,
        [&](const FiberThread& thread) { device::gather<false>(thread, view, shared); });
  }
  void prepare(const RunView& view) {
    BranchShared shared;
    run(view.instance_count * view.worker_blocks, shared,
        [&](const FiberThread& thread) { device::prepare(thread, view, shared); });
  }
  void decode_elastic(const RunView& view) {
    ElasticShared shared;
    run(view.instance_count * view.decode_blocks, shared,
        [&](const FiberThread& thread) { device::decode_elastic(thread, view, shared); });
  }
  void gather_and_project(const RunView& view) {
    GatherAndProjectShared shared;
    run(view.instance_count * view.gather_blocks, shared,
        [&](const FiberThread& thread) { device::gather_and_project(thread, view, shared); });
  }
  /// What the last block of gather_and_project does for an instance.
  void project(const RunView& view) {
    ProjectionShared shared;
    run(view.instance_count, shared,
        [&](const FiberThread& thread) { device::project(thread, view, view.instances[thread.index()], shared); });
  }
  /// What the first block of decode does for an instance.
  void solve_equations(const RunView& view) {
    int unused = 0;
    std::vector<double> room = equation_room(view);
    run(view.instance_count, unused, [&](const FiberThread& thread) {
      const InstanceView& instance = view.instances[thread.index()];
      Equations<FiberThread>{thread, view.model, instance, {room.data(), view.model}}.solve(view.model.gram);
    });
  }
  void fit(const RunView& view) {
    FitShared shared;
    std::vector<double> room = equation_room(view);
    run(view.instance_count, shared,
        [&](const FiberThread& thread) { device::fit(thread, view, shared, room.data()); });
  }
  void write_frame(const RunView& view, int instance, float* frame) {
    DecodeShared shared;
    run(3, shared, [&](const FiberThread& thread) { device::write_frame(thread, view, instance, frame, shared); });
  }
  void write(const std::byte* from, std::size_t bytes, std::byte* to) { std::copy_n(from, bytes, to); }
  template <typename T>
  void read(const T* from, std::size_t n, T* to) {
    std::copy_n(from, n, to);
  }
  template <typename Work>
  void record(int kind, const Work& work) {
    recorded_[kind] = work;
  }
  void play(int kind) { recorded_.at(kind)(); }
  template <typename Work>
  double timed(const Work& work) {
    work();
    return 0;
  }

 private:
  template <typename Group>
  void branch_by(const RunView& view) {
    BranchShared shared;
    run(branch_blocks<Group>(view), shared,
        [&](const FiberThread& thread) { device::branch<Group>(thread, view, shared); });
  }
  static std::vector<double> equation_room(const RunView& view) {
    return std::vector<double>(static_cast<std::size_t>(EquationCapacity::size(view.model)), std::nan(""));
  }
  template <typename Shared>
  void run(int blocks, Shared& shared, const FiberBlock::Kernel& kernel) {
    for (int i = 0; i < blocks; ++i) {
      std::memset(static_cast<void*>(&shared), 0xa5, sizeof(Shared));  // shared memory starts undefined
      block_.begin(i, blocks, kernel);
      while (!block_.go_on()) {
      }
    }
  }
  std::map<int, std::function<void()>> recorded_;
  FiberBlock block_{step_threads};
};

}  // namespace graupel::rom::device
