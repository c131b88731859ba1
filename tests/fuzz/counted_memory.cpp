#include "tests/fuzz/counted_memory.h"

#include <cstdlib>
#include <new>

namespace graupel::fuzz {

std::atomic<std::size_t> largest_request = 0;

}  // namespace graupel::fuzz

void* operator new(std::size_t bytes) {
  std::atomic<std::size_t>& largest = graupel::fuzz::largest_request;
  std::size_t before = largest;
  while (bytes > before && !largest.compare_exchange_weak(before, bytes)) {
  }
  void* memory = std::malloc(bytes > 0 ? bytes : 1);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
