#include "graph/features/particle_lifecycle.h"

#include <algorithm>
#include <cmath>

#include "core/system/error.h"

namespace graupel::graph {

namespace {

/// Whether the straight way from a to b has a point in the box about 0.
bool meets_box(const Vec3d& a, const Vec3d& b, const Vec3d& size) {
  double enter = 0, exit = 1;
  for (int d = 0; d < 3; ++d) {
    const double half = size[d] / 2, way = b[d] - a[d];
    if (std::max(a[d], b[d]) < -half || std::min(a[d], b[d]) > half) return false;  // most: no quotient is needed
    if (way == 0) continue;
    const double first = (-half - a[d]) / way, second = (half - a[d]) / way;
    enter = std::max(enter, std::min(first, second));
    exit = std::min(exit, std::max(first, second));
  }
  return enter <= exit;
}

/// Whether the straight way from a to b meets the region.
bool meets(const Region& region, const Vec3d& a, const Vec3d& b) {
  if (region.contains(b)) return true;
  const Vec3d from = a - region.position, way = b - a;
  if (region.shape == RegionShape::half_space) return region.contains(a);
  if (region.shape == RegionShape::box) return meets_box(from, b - region.position, region.size);
  const double length2 = norm2(way), nearest = length2 > 0 ? std::clamp(-dot(from, way) / length2, 0.0, 1.0) : 0;
  return norm2(from + nearest * way) <= region.radius * region.radius;
}

}  // namespace

void add_past_of_born(const Scene& scene, const ParticleSchedule& schedule, double time,
                      std::vector<std::vector<Vec3f>>& positions) {
  for (std::size_t f = 0; f < positions.size(); ++f) {
    const double then = time - static_cast<double>(positions.size() - 1 - f) * scene.frame_time;
    for (std::size_t i = 0; i < schedule.birth_time.size(); ++i) {
      const double birth = schedule.birth_time[i];
      if (!was_born_between(birth, then, time)) continue;
      positions[f][i] = flight_since_birth(positions[f][i], schedule.birth_velocity[i], scene.gravity, then - birth);
    }
  }
}

ParticleLifecycle::ParticleLifecycle(const Scene& scene, const ParticleSchedule* schedule,
                                     const std::vector<Vec3f>& place, const std::vector<uint8_t>& active,
                                     double start_time)
    : scene_(scene), schedule_(schedule), birth_place_(place) {
  const bool some_born_later = schedule != nullptr && !schedule->birth_time.empty();
  if (!scene.has_inactive_particles() && !some_born_later) return;
  active_ = active.empty() ? std::vector<uint8_t>(place.size(), 1) : active;
  GRAUPEL_ASSERT(active_.size() == place.size());
  for (std::size_t i = 0; some_born_later && i < place.size(); ++i) {
    if (schedule->birth_time[i] <= start_time) continue;
    active_[i] = 0;
    unborn_.push_back(static_cast<int32_t>(i));
  }
  list_present();
}

void ParticleLifecycle::list_present() {
  present_.clear();
  for (std::size_t i = 0; i < active_.size(); ++i)
    if (active_[i] != 0) present_.push_back(static_cast<int32_t>(i));
}

bool ParticleLifecycle::appear(const Environment& environment, std::vector<std::vector<Vec3f>>& history, double time) {
  std::vector<int32_t> still_unborn;
  for (const int32_t particle : unborn_) {
    const auto i = static_cast<std::size_t>(particle);
    const double birth = schedule_->birth_time[i];
    if (birth > time) {
      still_unborn.push_back(particle);
      continue;
    }
    active_[i] = 1;
    for (std::size_t f = 0; f < history.size(); ++f) {
      const double then = time - static_cast<double>(history.size() - 1 - f) * scene_.frame_time;
      history[f][i] = flight_since_birth(birth_place_[i], schedule_->birth_velocity[i], scene_.gravity, then - birth);
      if (environment.plane) history[f][i][2] = static_cast<float>(*environment.plane);
    }
    environment.swept_collision(Device::cpu).follow(birth_place_[i], history.back()[i]);
  }
  const bool some = still_unborn.size() < unborn_.size();
  unborn_ = std::move(still_unborn);
  if (some) list_present();
  return some;
}

bool ParticleLifecycle::leave(const Environment& environment, const std::vector<uint8_t>& kinematic,
                              std::vector<std::vector<Vec3f>>& history) {
  bool some_gone = false;
  const auto test = [&](std::size_t i) {
    if (!kinematic.empty() && kinematic[i] != 0) return;
    Vec3f& x = history.back()[i];
    const Vec3d before = history[history.size() - 2][i].cast<double>(), after = x.cast<double>();
    bool out = false;
    for (int d = 0; d < 3; ++d) {
      const double period = environment.period[d];
      const bool below = environment.hold_low[d] < environment.box_low[d] &&
                         after[d]<environment.box_low[d], above = environment.hold_high[d]> environment.box_high[d] &&
                         after[d] > environment.box_high[d];
      if (!below && !above) continue;
      if (period == 0) {
        out = true;
      } else {
        for (std::vector<Vec3f>& frame : history) frame[i][d] += static_cast<float>(below ? period : -period);
      }
    }
    for (const Sink& sink : scene_.sinks) out = out || meets(sink, before, after);
    if (!out) return;
    active_[i] = 0;
    some_gone = true;
  };
  if (changes())
    for (const int32_t i : present_) test(static_cast<std::size_t>(i));
  else if (environment.is_periodic())
    for (std::size_t i = 0; i < history.back().size(); ++i) test(i);
  if (some_gone) list_present();
  return some_gone;
}

}  // namespace graupel::graph
