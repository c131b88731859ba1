#include "graph/features/frame_step.h"

#include <algorithm>

#include "core/system/error.h"

namespace graupel::graph {

bool step_frame(const Scene& scene, const std::vector<Vec3f>& before, const std::vector<Vec3f>& current,
                const std::vector<Vec3f>& acceleration, std::vector<Vec3f>& next) {
  GRAUPEL_ASSERT(before.size() == current.size() && acceleration.size() == current.size());
  const Vec3d& size = scene.domain.size;
  const auto limit = static_cast<float>(std::max({size[0], size[1], size[2]}));
  next.resize(current.size());
  bool usable = true;
  for (std::size_t i = 0; i < current.size(); ++i) {
    const Vec3f velocity = current[i] - before[i] + acceleration[i];
    next[i] = current[i] + velocity;
    usable = usable && norm2(velocity) <= limit * limit;  // false for NaN
  }
  return usable;
}

}  // namespace graupel::graph
