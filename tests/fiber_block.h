// A block of threads on the CPU: every thread is a fiber (ucontext) that runs until its next barrier, so that kernels
// written over core/parallel/thread_block.h run, barriers and shared memory included, where there is no GPU. Blocks run
// one after the other. A barrier that not all threads of the block or warp reach ends the test.
#pragma once

#include <ucontext.h>
#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include "core/parallel/thread_block.h"

namespace graupel {

class FiberBlock;

/// What ThreadSanitizer knows of a fiber; nothing in other builds.
class FiberIdentity {
 public:
#ifdef __SANITIZE_THREAD__
  static FiberIdentity of_this_thread() { return FiberIdentity(__tsan_get_current_fiber()); }
  static FiberIdentity make() { return FiberIdentity(__tsan_create_fiber(0)); }
  void destroy() { __tsan_destroy_fiber(fiber_); }
  void before_switch() const { __tsan_switch_to_fiber(fiber_, 0); }

 private:
  explicit FiberIdentity(void* fiber) : fiber_(fiber) {}
  void* fiber_;
#else
  static FiberIdentity of_this_thread() { return {}; }
  static FiberIdentity make() { return {}; }
  void destroy() {}
  void before_switch() const {}
#endif
};

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
  template <typename T>
  T fresh(const T* place) const {
    return *place;
  }
};

/// What one thread of the kernel sees.
class FiberThread : public FiberAtomics {
 public:
  FiberThread(FiberBlock& block, int thread) : block_(&block), thread_(thread) {}
  int index() const;
  int thread() const { return thread_; }
  int threads() const;
  int blocks() const;
  void sync() const;
  void sync_warp() const;
  uint32_t ballot(bool yes) const;
  float shuffle_xor(float value, int mask) const;
  void arrive(uint32_t* arrivals, uint32_t count) const { *arrivals += count; }
  void add_units(long long* sum, long long units) const { *sum += units; }
  long long nearest_integer(float value) const { return std::llrint(value); }
  void pause() const;

 private:
  FiberBlock* block_;
  int thread_;
};

class FiberBlock {
 public:
  using Kernel = std::function<void(const FiberThread&)>;

  explicit FiberBlock(int threads) : fibers_(static_cast<std::size_t>(threads)) {
    for (Fiber& fiber : fibers_) fiber.stack.reset(new char[stack_bytes]);  // not cleared: few of its pages are touched
  }
  ~FiberBlock() {
    for (Fiber& fiber : fibers_) fiber.identity.destroy();
  }
  FiberBlock(const FiberBlock&) = delete;
  FiberBlock& operator=(const FiberBlock&) = delete;
  int index() const { return index_; }
  int threads() const { return static_cast<int>(fibers_.size()); }
  int blocks() const { return blocks_; }

  /// Runs the kernel for one block. Throws std::logic_error when threads wait at different barriers for ever.
  void run(int index, const Kernel& kernel) {
    begin(index, index + 1, kernel);
    while (!go_on()) {
    }
  }
  /// The same in pieces, for blocks that wait for each other: begin(), then go_on() until it returns true.
  void begin(int index, int blocks, const Kernel& kernel) {
    index_ = index;
    blocks_ = blocks;
    kernel_ = &kernel;
    scheduler_identity_ = FiberIdentity::of_this_thread();
    for (std::size_t t = 0; t < fibers_.size(); ++t) start(t);
  }
  /// Runs every thread that can to its next barrier or pause; whether all have ended.
  bool go_on() {
    bool running = false;
    for (std::size_t t = 0; t < fibers_.size(); ++t)
      if (fibers_[t].state == State::ready) {
        resume(t);
        running = true;
      }
    if (running) {
      release_warps();
      return false;
    }
    if (all(0, fibers_.size(), State::done)) return true;
    if (!release(0, fibers_.size(), State::at_block_barrier))
      throw std::logic_error("threads of a block wait at different barriers");
    return false;
  }

  enum class State { ready, at_warp_barrier, at_block_barrier, done };
  /// Hands over to the other threads; State::ready for a thread that only looks again later.
  void wait(int thread, State state) {
    Fiber& fiber = fibers_[static_cast<std::size_t>(thread)];
    fiber.state = state;
    scheduler_identity_.before_switch();
    swapcontext(&fiber.context, &scheduler_);
  }
  uint32_t ballot(int thread, bool yes) {
    fibers_[static_cast<std::size_t>(thread)].vote = yes;
    wait(thread, State::at_warp_barrier);
    uint32_t votes = 0;
    const int first = thread / warp_width * warp_width;
    for (int lane = 0; lane < warp_width; ++lane)
      if (fibers_[static_cast<std::size_t>(first + lane)].vote) votes |= uint32_t{1} << lane;
    wait(thread, State::at_warp_barrier);
    return votes;
  }

  float shuffle_xor(int thread, float value, int mask) {
    fibers_[static_cast<std::size_t>(thread)].shown = value;
    wait(thread, State::at_warp_barrier);
    const float other = fibers_[static_cast<std::size_t>(thread ^ mask)].shown;
    wait(thread, State::at_warp_barrier);
    return other;
  }

 private:
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
  static constexpr std::size_t stack_bytes = 1024 * 1024;  // their functions have large frames
#else
  static constexpr std::size_t stack_bytes = 128 * 1024;
#endif
  struct Fiber {
    FiberIdentity identity = FiberIdentity::make();
    std::unique_ptr<char[]> stack;
    ucontext_t context;
    State state = State::ready;
    bool vote = false;
    float shown = 0;
  };

  static void enter(unsigned low, unsigned high, unsigned thread) {
    auto* self = reinterpret_cast<FiberBlock*>((static_cast<uintptr_t>(high) << 32) | low);
    (*self->kernel_)(FiberThread(*self, static_cast<int>(thread)));
    self->fibers_[thread].state = State::done;
    self->scheduler_identity_.before_switch();
    swapcontext(&self->fibers_[thread].context, &self->scheduler_);
  }
  void start(std::size_t t) {
    Fiber& fiber = fibers_[t];
    fiber.state = State::ready;
    getcontext(&fiber.context);
    fiber.context.uc_stack.ss_sp = fiber.stack.get();
    fiber.context.uc_stack.ss_size = stack_bytes;
    fiber.context.uc_link = nullptr;
    const auto self = reinterpret_cast<uintptr_t>(this);
    makecontext(&fiber.context, reinterpret_cast<void (*)()>(enter), 3, static_cast<unsigned>(self),
                static_cast<unsigned>(self >> 32), static_cast<unsigned>(t));
  }
  void resume(std::size_t t) {
    fibers_[t].identity.before_switch();
    swapcontext(&scheduler_, &fibers_[t].context);
  }
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
  FiberIdentity scheduler_identity_ = FiberIdentity::of_this_thread();
  const Kernel* kernel_ = nullptr;
  int index_ = 0, blocks_ = 1;
};

inline int FiberThread::index() const { return block_->index(); }
inline int FiberThread::threads() const { return block_->threads(); }
inline int FiberThread::blocks() const { return block_->blocks(); }
inline void FiberThread::sync() const { block_->wait(thread_, FiberBlock::State::at_block_barrier); }
inline void FiberThread::sync_warp() const { block_->wait(thread_, FiberBlock::State::at_warp_barrier); }
inline uint32_t FiberThread::ballot(bool yes) const { return block_->ballot(thread_, yes); }
inline float FiberThread::shuffle_xor(float value, int mask) const { return block_->shuffle_xor(thread_, value, mask); }
inline void FiberThread::pause() const { block_->wait(thread_, FiberBlock::State::ready); }

}  // namespace graupel
