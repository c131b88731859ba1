// Which particles are samples: those that the latent is fitted to after each step (NSF section 5.3).
#pragma once

#include <cstdint>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"
#include "rom/mode_table.h"

namespace graupel {
namespace rom {

enum class SampleRule {
  random,   ///< as in the paper
  spread,   ///< every so manyth in an order in which neighbours follow each other
  patches,  ///< the same, in groups of 16 neighbours, which need fewer integration points
  optimal   ///< those that tell most of the modes: greedy D-optimal design
};

}  // namespace rom

template <>
struct EnumWords<rom::SampleRule> {
  static constexpr std::pair<const char*, rom::SampleRule> words[] = {{"random", rom::SampleRule::random},
                                                                      {"spread", rom::SampleRule::spread},
                                                                      {"patches", rom::SampleRule::patches},
                                                                      {"optimal", rom::SampleRule::optimal}};
};

namespace rom {

/// Those of the points whose place in the reference body [particles, 3] lies in a box [m], in their order.
std::vector<int32_t> points_within(const std::vector<int32_t>& points, const std::vector<float>& reference,
                                   const Vec3d& low, const Vec3d& high);

/// `count` of the candidates (all of them where there are no more), ascending. `candidates`: integration points in the
/// order of their clusters.
///   optimal: from U the rows of the deformation's modes and A = 1e-3 U^T U / particles, takes again and again the
///   sample s with the largest det(I + U_s A^-1 U_s^T) and adds U_s^T U_s to A.
std::vector<int32_t> choose_samples(SampleRule rule, const ModeTable& deformation,
                                    const std::vector<int32_t>& candidates, int64_t count, uint64_t seed);

}  // namespace rom
}  // namespace graupel
