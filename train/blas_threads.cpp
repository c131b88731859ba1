#include "train/blas_threads.h"

#include <dlfcn.h>

namespace graupel::train {

namespace {

/// A function of OpenBLAS, which libtorch brings along or not; null where it does not.
template <typename Function>
Function* openblas(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

}  // namespace

SingleThreadedBlas::SingleThreadedBlas() {
  const auto get = openblas<int()>("openblas_get_num_threads");
  const auto set = openblas<void(int)>("openblas_set_num_threads");
  if (get == nullptr || set == nullptr) return;
  before_ = get();
  set(1);
}

SingleThreadedBlas::~SingleThreadedBlas() {
  if (before_ > 0) openblas<void(int)>("openblas_set_num_threads")(before_);
}

}  // namespace graupel::train
