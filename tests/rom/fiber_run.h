// Runs the kernels of a reduced-order model's step on the CPU, with fibers for threads.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "rom/cuda/device_run.h"
#include "tests/fiber_block.h"

namespace graupel::rom::device {

/// A block of a team; all of them take turns.
class FiberTeam : public FiberThread {
 public:
  struct Team {
    int size;
    uint32_t arrivals = 0;
    std::vector<std::vector<unsigned char>> memory;
  };
  FiberTeam(const FiberThread& thread, Team& team, int rank) : FiberThread(thread), team_(&team), rank_(rank) {}
  int rank() const { return rank_; }
  int size() const { return team_->size; }
  int index() const { return rank_ + team_->size * instance_; }
  void set_instance(int instance) { instance_ = instance; }
  void team_sync() const {
    sync();
    if (thread() == 0) arrive(&team_->arrivals, 1);
    const uint32_t wanted = static_cast<uint32_t>(++meetings_ * team_->size);
    while (team_->arrivals < wanted) pause();
    sync();
  }
  template <typename T>
  T* at(T* own, int rank) const {
    unsigned char* const base = team_->memory[static_cast<std::size_t>(rank_)].data();
    const auto offset = reinterpret_cast<unsigned char*>(own) - base;
    return reinterpret_cast<T*>(team_->memory[static_cast<std::size_t>(rank)].data() + offset);
  }

 private:
  Team* team_;
  int rank_, instance_ = 0;
  mutable int meetings_ = 0;
};

/// `team_size` blocks fit an instance.
template <int team_size>
class FiberBackend {
 public:
  Device device() const { return Device::cpu; }
  int processors() const { return 1; }
  int team() const { return team_size; }
  void wait() {}
  void prepare(int64_t) {}
  template <typename Body>
  void launch(int64_t n, const Body& body) {
    for (int64_t i = 0; i < n; ++i) body(i);
  }
  void branch(const RunView& view) {
    BranchShared shared;
    run(view.instance_count * (view.branch_blocks + view.worker_blocks), shared,
        [&](const FiberThread& thread) { device::branch(thread, view, shared); });
  }
  void decode(const RunView& view) {
    DecodeShared shared;
    run(view.instance_count * view.decode_blocks, shared,
        [&](const FiberThread& thread) { device::decode(thread, view, shared); });
  }
  void gather(const RunView& view) {
    int none;
    run(view.instance_count * view.gather_blocks, none,
        [&](const FiberThread& thread) { device::gather(thread, view); });
  }
  void fit(const RunView& view, int64_t bytes) {
    run_team(view, bytes, [&](const FiberTeam& team, unsigned char* memory) { device::fit(team, view, memory); });
  }
  void mark(const RunView& view, int64_t bytes) {
    run_team(view, bytes, [&](const FiberTeam& team, unsigned char* memory) { device::mark(team, view, memory); });
  }
  void write_frame(const RunView& view, int instance, float* frame) {
    int none;
    run(3, none, [&](const FiberThread& thread) { device::write_frame(thread, view, instance, frame); });
  }
  template <typename T>
  void read(const T* from, std::size_t n, T* to) {
    std::copy_n(from, n, to);
  }
  template <typename Work>
  void record(int, const Work& work) {
    last_ = work;
  }
  void play(int) { last_(); }
  template <typename Work>
  double timed(const Work& work) {
    work();
    return 0;
  }

 private:
  template <typename Shared>
  void run(int blocks, Shared& shared, const FiberBlock::Kernel& kernel) {
    for (int i = 0; i < blocks; ++i) {
      std::memset(static_cast<void*>(&shared), 0xa5, sizeof(Shared));  // shared memory starts undefined
      block_.begin(i, blocks, kernel);
      while (!block_.go_on()) {
      }
    }
  }
  template <typename Kernel>
  void run_team(const RunView& view, int64_t bytes, const Kernel& kernel) {
    for (int instance = 0; instance < view.instance_count; ++instance) {
      FiberTeam::Team team{team_size, 0, {}};
      team.memory.assign(team_size, std::vector<unsigned char>(static_cast<std::size_t>(bytes), 0xa5));
      std::vector<FiberBlock::Kernel> kernels;
      std::vector<bool> done(team_size, false);
      for (int rank = 0; rank < team_size; ++rank)
        kernels.push_back([&team, &kernel, rank, instance](const FiberThread& thread) {
          FiberTeam member(thread, team, rank);
          member.set_instance(instance);
          kernel(member, team.memory[static_cast<std::size_t>(rank)].data());
        });
      while (static_cast<int>(team_.size()) < team_size) team_.push_back(std::make_unique<FiberBlock>(fiber_threads));
      for (int rank = 0; rank < team_size; ++rank)
        team_[static_cast<std::size_t>(rank)]->begin(rank, team_size, kernels[static_cast<std::size_t>(rank)]);
      for (bool running = true; running;) {
        running = false;
        for (std::size_t rank = 0; rank < done.size(); ++rank) {
          if (!done[rank]) done[rank] = team_[rank]->go_on();
          running = running || !done[rank];
        }
      }
    }
  }

  static constexpr int fiber_threads = 64;
  std::function<void()> last_;
  FiberBlock block_{step_threads};
  std::vector<std::unique_ptr<FiberBlock>> team_;
};

}  // namespace graupel::rom::device
