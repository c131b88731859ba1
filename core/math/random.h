// Counter-based random numbers (Philox4x32-10, Salmon et al. 2011): the value depends on the key and the counter
// alone, so results do not depend on threads, order or device.
#pragma once

#include <Random123/philox.h>

#include <cmath>
#include <cstdint>

#include "core/parallel/host_device.h"

namespace graupel {

/// What a stream of random numbers is used for; streams of different purpose are independent.
enum class RandomPurpose : uint32_t {
  particle_position = 1,
  scene_layout = 2,
  training_noise = 3,
  grid_jitter = 4,
  batch_order = 5,
  weight_init = 6,
  surface_sample = 7,
  metric_subset = 8,
  training_symmetry = 9,
  emission = 10,
  sample_particle = 11,
  test = 99
};

/// Random numbers keyed by (seed, purpose, stream); draw number `index` can be asked for in any order.
class Random {
 public:
  GRAUPEL_HD Random(uint64_t seed, RandomPurpose purpose, uint64_t stream = 0) : stream_(stream) {
    key_.v[0] = static_cast<uint32_t>(seed);
    key_.v[1] = static_cast<uint32_t>(seed >> 32) ^ (static_cast<uint32_t>(purpose) * 0x9E3779B9u);
  }

  /// Four independent 32-bit words for draw `index`.
  GRAUPEL_HD r123::Philox4x32::ctr_type words(uint64_t index) const {
    r123::Philox4x32::ctr_type counter;
    counter.v[0] = static_cast<uint32_t>(index);
    counter.v[1] = static_cast<uint32_t>(index >> 32);
    counter.v[2] = static_cast<uint32_t>(stream_);
    counter.v[3] = static_cast<uint32_t>(stream_ >> 32);
    return r123::Philox4x32()(counter, key_);
  }
  /// Uniform in [0, 1), component c in 0..3 of draw `index`.
  GRAUPEL_HD double uniform(uint64_t index, int c = 0) const {
    return static_cast<double>(words(index).v[c]) * (1.0 / 4294967296.0);
  }
  GRAUPEL_HD double uniform(uint64_t index, int c, double low, double high) const {
    return low + (high - low) * uniform(index, c);
  }
  /// Integer in [0, n), n < 2^31.
  GRAUPEL_HD uint32_t integer(uint64_t index, int c, uint32_t n) const {
    return static_cast<uint32_t>((static_cast<uint64_t>(words(index).v[c]) * n) >> 32);
  }
  /// Two standard normal numbers (Box-Muller) for draw `index`; pair 0 or 1.
  GRAUPEL_HD void normal(uint64_t index, int pair, double& a, double& b) const {
    const auto w = words(index);
    const double u = (static_cast<double>(w.v[2 * pair]) + 0.5) * (1.0 / 4294967296.0);
    const double phase = 6.283185307179586 * static_cast<double>(w.v[2 * pair + 1]) * (1.0 / 4294967296.0);
    const double r = std::sqrt(-2.0 * std::log(u));
    a = r * std::cos(phase);
    b = r * std::sin(phase);
  }

 private:
  r123::Philox4x32::key_type key_;
  uint64_t stream_;
};

}  // namespace graupel
