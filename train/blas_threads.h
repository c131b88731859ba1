// Threads of the BLAS beneath libtorch. Where many small products run side by side, OpenBLAS's own threads wait for one
// another; other libraries (MKL, BLIS) follow OpenMP, and nothing is done.
#pragma once

namespace graupel::train {

/// One thread a product while this lives, for the whole process.
class SingleThreadedBlas {
 public:
  SingleThreadedBlas();
  ~SingleThreadedBlas();
  SingleThreadedBlas(const SingleThreadedBlas&) = delete;
  SingleThreadedBlas& operator=(const SingleThreadedBlas&) = delete;

 private:
  int before_ = 0;  ///< 0: no OpenBLAS
};

}  // namespace graupel::train
