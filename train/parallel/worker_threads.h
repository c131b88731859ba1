// Threads that prepare data ahead of the training loop; what they make does not depend on their number.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "core/parallel/device.h"

namespace graupel::train {

/// Calls body(i) for i in [0, n) on `threads` threads, each with one OpenMP thread; rethrows the first exception.
void for_each_index(int threads, int64_t n, const std::function<void(int64_t)>& body);

/// Makes items number `first`, `first` + 1, ... `end` - 1 on worker threads, at most `ahead` of them early, and hands
/// them out in order.
template <typename T>
class OrderedQueue {
 public:
  OrderedQueue(int workers, int64_t first, int64_t end, int64_t ahead, std::function<T(int64_t)> make)
      : next_to_make_(first), next_to_take_(first), end_(end), ahead_(ahead), make_(std::move(make)) {
    for (int i = 0; i < workers; ++i) threads_.emplace_back([this] { work(); });
  }
  ~OrderedQueue() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }
  OrderedQueue(const OrderedQueue&) = delete;
  OrderedQueue& operator=(const OrderedQueue&) = delete;

  /// The next item in order; throws what its maker threw.
  T next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return ready_.count(next_to_take_) > 0; });
    Slot slot = std::move(ready_.extract(next_to_take_).mapped());
    ++next_to_take_;
    lock.unlock();
    changed_.notify_all();
    if (slot.error) std::rethrow_exception(slot.error);
    return std::move(slot.item);
  }

 private:
  struct Slot {
    T item;
    std::exception_ptr error;
  };

  void work() {
    set_num_threads(1);
    while (true) {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stop_ || next_to_make_ >= end_ || next_to_make_ < next_to_take_ + ahead_; });
      if (stop_ || next_to_make_ >= end_) return;
      const int64_t number = next_to_make_++;
      lock.unlock();
      Slot slot;
      try {
        slot.item = make_(number);
      } catch (...) {
        slot.error = std::current_exception();
      }
      lock.lock();
      ready_.emplace(number, std::move(slot));
      lock.unlock();
      changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<int64_t, Slot> ready_;
  int64_t next_to_make_, next_to_take_, end_, ahead_;
  bool stop_ = false;
  std::function<T(int64_t)> make_;
  std::vector<std::thread> threads_;
};

}  // namespace graupel::train
