// Counter-based random numbers (Philox4x32-10, Salmon et al. 2011): the value depends on the key and the counter
// alone, so results do not depend on threads, order or device.
#pragma once

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

/// Four 32-bit words: a counter of Philox, or the numbers that it becomes.
struct RandomWords {
  uint32_t v[4];
};

/// Philox4x32-10 (Salmon et al. 2011, section 3.3): ten rounds of two 32 x 32 -> 64 bit products; the key is raised by
/// its Weyl constants between rounds. Written out here, since Random123 brings the processor's intrinsics and streams
/// into every file; tests/core/random_test.cpp holds it against Random123.
GRAUPEL_HD inline RandomWords philox(RandomWords counter, uint32_t key_low, uint32_t key_high) {
  for (int round = 0; round < 10; ++round) {
    const uint64_t a = uint64_t{0xD2511F53u} * counter.v[0], b = uint64_t{0xCD9E8D57u} * counter.v[2];
    counter = {{static_cast<uint32_t>(b >> 32) ^ counter.v[1] ^ key_low, static_cast<uint32_t>(b),
                static_cast<uint32_t>(a >> 32) ^ counter.v[3] ^ key_high, static_cast<uint32_t>(a)}};
    key_low += 0x9E3779B9u;
    key_high += 0xBB67AE85u;
  }
  return counter;
}

/// Random numbers keyed by (seed, purpose, stream); draw number `index` can be asked for in any order.
class Random {
 public:
  GRAUPEL_HD Random(uint64_t seed, RandomPurpose purpose, uint64_t stream = 0)
      : key_low_(static_cast<uint32_t>(seed)),
        key_high_(static_cast<uint32_t>(seed >> 32) ^ (static_cast<uint32_t>(purpose) * 0x9E3779B9u)),
        stream_(stream) {}

  /// Four independent 32-bit words for draw `index`.
  GRAUPEL_HD RandomWords words(uint64_t index) const {
    return philox({{static_cast<uint32_t>(index), static_cast<uint32_t>(index >> 32), static_cast<uint32_t>(stream_),
                    static_cast<uint32_t>(stream_ >> 32)}},
                  key_low_, key_high_);
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
  uint32_t key_low_, key_high_;
  uint64_t stream_;
};

}  // namespace graupel
