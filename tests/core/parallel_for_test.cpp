#include "core/parallel/parallel_for.h"

#include <gtest/gtest.h>

#include <numeric>

#include "core/math/svd.h"
#include "core/parallel/buffer.h"
#include "tests/gpu_only.h"

namespace graupel {
namespace {

struct Square {
  const int* in;
  int* out;
  GRAUPEL_HD void operator()(int64_t i) const { out[i] = in[i] * in[i] + 1; }
};

void squares_on(Device device) {
  std::vector<int> host(10007);
  std::iota(host.begin(), host.end(), 0);
  Buffer<int> in(device, 0), out(device, host.size());
  in.upload(host);
  out.fill_zero();
  parallel_for(device, static_cast<int64_t>(host.size()), Square{in.data(), out.data()});
  const std::vector<int> result = out.download();
  for (std::size_t i = 0; i < host.size(); ++i) ASSERT_EQ(result[i], host[i] * host[i] + 1);
}

TEST(ParallelFor, EveryItemOnceOnTheCpu) { squares_on(Device::cpu); }

TEST(ParallelFor, EveryItemOnceOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  squares_on(Device::cuda);
}

/// Rotation R of the polar decomposition F = R S.
GRAUPEL_HD Mat3f polar_rotation(const Mat3f& F) {
  const Svd<float, 3> d = svd(F);
  return d.U * transpose(d.V);
}

struct PolarOf {
  const Mat3f* in;
  Mat3f* out;
  GRAUPEL_HD void operator()(int64_t i) const { out[i] = polar_rotation(in[i]); }
};

TEST(ParallelFor, PolarDecompositionOnTheGpuEqualsTheCpu) {
  GRAUPEL_NEEDS_GPU();
  std::vector<Mat3f> host(1000);
  for (std::size_t i = 0; i < host.size(); ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        host[i](r, c) = (r == c ? 1.0f : 0.0f) + 0.1f * std::sin(static_cast<float>(7 * i + 3 * r + c));
  Buffer<Mat3f> in(Device::cuda, 0), out(Device::cuda, host.size());
  in.upload(host);
  parallel_for(Device::cuda, static_cast<int64_t>(host.size()), PolarOf{in.data(), out.data()});
  const auto result = out.download();
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Mat3f expected = polar_rotation(host[i]);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(result[i](r, c), expected(r, c), 3e-6f);
  }
}

}  // namespace
}  // namespace graupel
