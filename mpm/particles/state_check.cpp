#include "mpm/particles/state_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"

namespace graupel::mpm {

namespace {

[[noreturn]] void damaged(std::size_t slot, const std::string& what) {
  throw InputError(fmt::format("the saved state is damaged (slot {}: {}). Use an older one, or run again", slot, what));
}

template <typename T, std::size_t N>
bool all_finite(const T (&values)[N]) {
  return std::all_of(values, values + N, [](T x) { return std::isfinite(x); });
}

template <typename T>
bool is_finite(const Mat<T, 3>& m) {
  return all_finite(m.a[0]) && all_finite(m.a[1]) && all_finite(m.a[2]);
}

}  // namespace

template <typename T>
void check_state(const HostParticles<T>& p, const std::vector<Presence>& presence, int32_t materials,
                 const Domain& box) {
  const auto count = static_cast<int32_t>(p.size());
  std::vector<uint8_t> is_taken(p.size());
  for (std::size_t slot = 0; slot < p.size(); ++slot) {
    const int32_t material = p.material[slot], particle = p.source_index[slot];
    if (material < 0 || material >= materials) damaged(slot, fmt::format("material {} of {}", material, materials));
    if (particle < 0 || particle >= count || is_taken[static_cast<std::size_t>(particle)]++ != 0)
      damaged(slot, fmt::format("particle {}, there are {}, once each", particle, count));
    if (!presence.empty() && presence[static_cast<std::size_t>(particle)] > Presence::gone)
      damaged(slot, fmt::format("presence {}", static_cast<int>(presence[static_cast<std::size_t>(particle)])));
    if (!all_finite(p.position[slot].a) || !all_finite(p.velocity[slot].a) || !all_finite(p.stress[slot].a) ||
        !is_finite(p.affine_velocity[slot]) || !is_finite(p.deformation_gradient[slot]) ||
        !std::isfinite(p.internal[slot]) || !(p.volume[slot] > 0 && std::isfinite(p.volume[slot])))
      damaged(slot, "numbers that are not finite, or a volume that is not above 0");
    if (!presence.empty() && presence[static_cast<std::size_t>(particle)] != Presence::active) continue;
    for (int d = 0; d < 3; ++d)
      if (!(p.position[slot][d] >= 0 && p.position[slot][d] <= static_cast<T>(box.size[d])))
        damaged(slot, fmt::format("position {} m along {}, outside of the domain", p.position[slot][d], "xyz"[d]));
  }
}

template void check_state(const HostParticles<float>&, const std::vector<Presence>&, int32_t, const Domain&);
template void check_state(const HostParticles<double>&, const std::vector<Presence>&, int32_t, const Domain&);

}  // namespace graupel::mpm
