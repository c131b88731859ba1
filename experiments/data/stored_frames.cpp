#include "experiments/data/stored_frames.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

constexpr const char* remedy = "Make the file again, or leave that frame out with --frames";

/// `place`: file, frame and particle.
void check(const Vec3f& x, float limit, const char* quantity, const char* allowed, const auto& place) {
  for (int d = 0; d < 3; ++d)
    if (!(std::abs(x[d]) <= limit))  // NaN too
      throw InputError(fmt::format("{}: {}{} = {} {}. {}", place(), quantity, "xyz"[d], x[d], allowed, remedy));
}

}  // namespace

void check_stored_frames(const std::vector<ParticleFrame>& frames, int64_t first, const std::string& what) {
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const ParticleFrame& frame = frames[f];
    const std::size_t particles = frame.position.size();
    for (std::size_t i = 0; i < particles; ++i) {
      if (!frame.is_active(i)) continue;
      const auto place = [&] {
        return fmt::format("{}: frame {}, particle {}", what, first + static_cast<int64_t>(f), i);
      };
      check(frame.position[i], 1e6f, "", "m (allowed: finite, -1e6 to 1e6 m)", place);
      if (!frame.velocity.empty())
        check(frame.velocity[i], std::numeric_limits<float>::max(), "velocity ", "m/s (allowed: finite)", place);
      for (const ParticleField field : all_particle_fields) {
        const std::vector<float>& values = frame.fields[field];
        const std::size_t width = values.size() / particles;
        for (std::size_t k = i * width; k < (i + 1) * width; ++k)
          if (!std::isfinite(values[k]))
            throw InputError(fmt::format("{}: {}[{}] = {} (allowed: finite). {}", place(), info_of(field).name,
                                         k - i * width, values[k], remedy));
      }
    }
  }
}

}  // namespace graupel::experiments
