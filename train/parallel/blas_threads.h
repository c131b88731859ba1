// Threads of the BLAS beneath libtorch. OpenBLAS may have threads of its own, which do not follow libtorch's setting;
// where many small products run side by side, they wait for one another. Other libraries (MKL, BLIS) follow OpenMP, and
// nothing is done.
#pragma once

#include <string>

namespace graupel::train {

/// The BLAS in use as OpenBLAS describes itself, and whose threads it takes; "" where it is another library.
std::string blas_description();

/// So many threads a product while this lives, for the whole process.
class BlasThreads {
 public:
  explicit BlasThreads(int threads);
  ~BlasThreads();
  BlasThreads(const BlasThreads&) = delete;
  BlasThreads& operator=(const BlasThreads&) = delete;

 private:
  int before_ = 0;  ///< 0: no OpenBLAS
};

}  // namespace graupel::train
