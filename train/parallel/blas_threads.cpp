#include "train/parallel/blas_threads.h"

#include <dlfcn.h>

namespace graupel::train {

namespace {

/// A function of OpenBLAS, which libtorch brings along or not; null where it does not.
template <typename Function>
Function* openblas(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

}  // namespace

std::string blas_description() {
  const auto config = openblas<char*()>("openblas_get_config");
  const auto parallel = openblas<int()>("openblas_get_parallel");
  if (config == nullptr || parallel == nullptr) return "";
  constexpr const char* threads[] = {"one thread", "threads of its own", "OpenMP's threads"};
  const int kind = parallel();
  return std::string(config()) + (kind >= 0 && kind < 3 ? std::string(", ") + threads[kind] : "");
}

BlasThreads::BlasThreads(int threads) {
  const auto get = openblas<int()>("openblas_get_num_threads");
  const auto set = openblas<void(int)>("openblas_set_num_threads");
  if (get == nullptr || set == nullptr) return;
  before_ = get();
  set(threads);
}

BlasThreads::~BlasThreads() {
  if (before_ > 0) openblas<void(int)>("openblas_set_num_threads")(before_);
}

}  // namespace graupel::train
