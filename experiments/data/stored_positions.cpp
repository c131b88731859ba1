#include "experiments/data/stored_positions.h"

#include <fmt/format.h>

#include <cmath>

#include "core/system/error.h"

namespace graupel::experiments {

void check_stored_positions(const std::vector<ParticleFrame>& frames, int64_t first, const std::string& what) {
  constexpr float limit = 1e6f;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const ParticleFrame& frame = frames[f];
    for (std::size_t i = 0; i < frame.position.size(); ++i) {
      if (!frame.active.empty() && frame.active[i] == 0) continue;
      for (int d = 0; d < 3; ++d)
        if (!(std::abs(frame.position[i][d]) <= limit))  // NaN too
          throw InputError(fmt::format(
              "{}: frame {}, particle {}: {} = {} m (allowed: finite, -1e6 to 1e6 m). Make the file again, or leave "
              "that frame out with --frames",
              what, first + static_cast<int64_t>(f), i, "xyz"[d], frame.position[i][d]));
    }
  }
}

}  // namespace graupel::experiments
