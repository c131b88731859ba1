// Which particles are samples: those that the latent is fitted to after each step (NSF section 5.3).
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/fields.h"

namespace graupel::rom {

enum class SampleRule {
  random,  ///< as in the paper
  spread,  ///< every so manyth in an order in which neighbours follow each other
  patches  ///< the same, in groups of 16 neighbours, which need fewer integration points
};

constexpr auto enum_list(SampleRule) {
  return std::to_array<std::pair<const char*, SampleRule>>(
      {{"random", SampleRule::random}, {"spread", SampleRule::spread}, {"patches", SampleRule::patches}});
}

/// Those of the points whose place in the reference body [particles, 3] lies in a box [m], in their order.
std::vector<int32_t> points_within(const std::vector<int32_t>& points, const std::vector<float>& reference,
                                   const Vec3d& low, const Vec3d& high);

/// `count` of the candidates (all of them where there are no more), ascending. `candidates`: integration points in the
/// order of their clusters.
std::vector<int32_t> choose_samples(SampleRule rule, const std::vector<int32_t>& candidates, int64_t count,
                                    uint64_t seed);

/// The samples and, where a script leads fewer than `least` of them, more of its particles, spread over its list: what
/// is prescribed at a kinematic boundary must reach the latent (CROM section 3.2.1 asks for five). `script` [particles]
/// is -1 for particles without one, empty where there is none.
std::vector<int32_t> with_boundary_samples(std::vector<int32_t> samples, const std::vector<int32_t>& script,
                                           int64_t least);

}  // namespace graupel::rom
