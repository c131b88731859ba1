// A block of threads on the CPU: every thread is a fiber (ucontext) that runs until its next barrier, so that kernels
// written over core/thread_block.h run, barriers and shared memory included, where there is no GPU. Blocks run one
// after the other. A barrier that not all threads of the block or warp reach ends the test.
#pragma once

#include <ucontext.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include "core/thread_block.h"

namespace graupel {

class FiberBlock;

/// Plain arithmetic for atomics: fibers are never interrupted.
struct FiberAtomics {
  template <typename T>
  T add(T* place, T value) const {
    const T old = *place;
    *place += value;
    return old;
  }
  template <typename T>
  T max(T* place, T value) const {
    const T old = *place;
    if (value > old) *place = value;
    return old;
  }
  template <typename T>
  T min(T* place, T value) const {
    const T old = *place;
    if (value < old) *place = value;
    return old;
  }
  template <typename T>
  T exchange(T* place, T value) const {
    const T old = *place;
    *place = value;
    return old;
  }
  void fence() const {}
};

/// What one thread of the kernel sees.
class FiberThread : public FiberAtomics {
 public:
  FiberThread(FiberBlock& block, int thread) : block_(&block), thread_(thread) {}
  int index() const;
  int thread() const { return thread_; }
  int threads() const;
  void sync() const;
  void sync_warp() const;

 private:
  FiberBlock* block_;
  int thread_;
};

class FiberBlock {
 public:
  using Kernel = std::function<void(const FiberThread&)>;

  explicit FiberBlock(int threads) : fibers_(static_cast<std::size_t>(threads)) {
    for (Fiber& fiber : fibers_) fiber.stack.resize(256 * 1024);
  }
  int index() const { return index_; }
  int threads() const { return static_cast<int>(fibers_.size()); }

  /// Runs the kernel for one block. Throws std::logic_error when threads wait at different barriers for ever.
  void run(int index, const Kernel& kernel) {
    index_ = index;
    kernel_ = &kernel;
    for (std::size_t t = 0; t < fibers_.size(); ++t) start(t);
    for (;;) {
      bool running = false;
      for (std::size_t t = 0; t < fibers_.size(); ++t)
        if (fibers_[t].state == State::ready) {
          resume(t);
          running = true;
        }
      if (running) {
        release_warps();
        continue;
      }
      if (all(0, fibers_.size(), State::done)) return;
      if (!release(0, fibers_.size(), State::at_block_barrier))
        throw std::logic_error("threads of a block wait at different barriers");
    }
  }

  void wait(int thread, bool whole_block) {
    Fiber& fiber = fibers_[static_cast<std::size_t>(thread)];
    fiber.state = whole_block ? State::at_block_barrier : State::at_warp_barrier;
    swapcontext(&fiber.context, &scheduler_);
  }

 private:
  enum class State { ready, at_warp_barrier, at_block_barrier, done };
  struct Fiber {
    std::vector<char> stack;
    ucontext_t context;
    State state = State::ready;
  };

  static void enter(unsigned low, unsigned high, unsigned thread) {
    auto* self = reinterpret_cast<FiberBlock*>((static_cast<uintptr_t>(high) << 32) | low);
    (*self->kernel_)(FiberThread(*self, static_cast<int>(thread)));
    self->fibers_[thread].state = State::done;
    swapcontext(&self->fibers_[thread].context, &self->scheduler_);
  }
  void start(std::size_t t) {
    Fiber& fiber = fibers_[t];
    fiber.state = State::ready;
    getcontext(&fiber.context);
    fiber.context.uc_stack.ss_sp = fiber.stack.data();
    fiber.context.uc_stack.ss_size = fiber.stack.size();
    fiber.context.uc_link = nullptr;
    const auto self = reinterpret_cast<uintptr_t>(this);
    makecontext(&fiber.context, reinterpret_cast<void (*)()>(enter), 3, static_cast<unsigned>(self),
                static_cast<unsigned>(self >> 32), static_cast<unsigned>(t));
  }
  void resume(std::size_t t) { swapcontext(&scheduler_, &fibers_[t].context); }
  bool all(std::size_t begin, std::size_t end, State state) const {
    for (std::size_t t = begin; t < end; ++t)
      if (fibers_[t].state != state) return false;
    return true;
  }
  /// Lets threads begin..end go on when all of them wait at this barrier; threads that have ended count as there.
  bool release(std::size_t begin, std::size_t end, State barrier) {
    bool any = false;
    for (std::size_t t = begin; t < end; ++t) {
      if (fibers_[t].state == State::done) continue;
      if (fibers_[t].state != barrier) return false;
      any = true;
    }
    for (std::size_t t = begin; t < end; ++t)
      if (fibers_[t].state == barrier) fibers_[t].state = State::ready;
    return any;
  }
  void release_warps() {
    for (std::size_t begin = 0; begin < fibers_.size(); begin += warp_width)
      release(begin, std::min(begin + warp_width, fibers_.size()), State::at_warp_barrier);
  }

  std::vector<Fiber> fibers_;
  ucontext_t scheduler_;
  const Kernel* kernel_ = nullptr;
  int index_ = 0;
};

inline int FiberThread::index() const { return block_->index(); }
inline int FiberThread::threads() const { return block_->threads(); }
inline void FiberThread::sync() const { block_->wait(thread_, true); }
inline void FiberThread::sync_warp() const { block_->wait(thread_, false); }

}  // namespace graupel
