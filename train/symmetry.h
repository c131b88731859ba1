// Training samples turned and mirrored: a scene's physics is the same under every permutation and reflection of the
// axes that leaves gravity alone (eight of them where gravity points along an axis), so each frame serves eight times.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/random.h"
#include "core/vec.h"
#include "graph/hgn_config.h"

namespace graupel::train {

/// (S v)[d] = sign[d] v[axis[d]], an orthogonal map of the axes onto themselves.
struct Symmetry {
  std::array<int, 3> axis = {0, 1, 2};
  std::array<int, 3> sign = {1, 1, 1};

  template <typename T>
  Vec<T, 3> apply(const Vec<T, 3>& v) const {
    Vec<T, 3> turned;
    for (int d = 0; d < 3; ++d) {
      const auto at = static_cast<std::size_t>(d);
      turned[d] = static_cast<T>(sign[at]) * v[axis[at]];
    }
    return turned;
  }
};

/// All maps with S gravity = gravity, the identity first.
std::vector<Symmetry> symmetries_of(const Vec3d& gravity);
/// One of them, each as likely, from draw 0 of `random`.
Symmetry draw_symmetry(const Vec3d& gravity, const Random& random);

/// Rewrites rows of graph::particle_features [n, input_width - embedding] as those of the turned scene, in place.
void apply_to_features(const Symmetry& symmetry, const graph::HgnConfig& config,
                       const graph::Normalization& normalization, std::vector<float>& features);

/// A box [low, high] turned about the origin.
void apply_to_box(const Symmetry& symmetry, Vec3d& low, Vec3d& high);

}  // namespace graupel::train
