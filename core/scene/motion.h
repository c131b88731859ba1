// Scripted rigid motion of obstacles and of particles: constant velocity and spin, or keyframes with straight lines
// between them. Evaluated at any time; nothing is integrated, so no error grows.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "core/math/mat.h"
#include "core/math/vec.h"
#include "core/scene/fields.h"
#include "core/scene/keyframes.h"

namespace graupel {

enum class MotionKind {
  constant,  ///< `velocity` and `spin` from `start_time` to `end_time`
  keyframes  ///< poses of `keyframes`; straight lines between them, from the initial pose at time 0
};
template <>
struct EnumWords<MotionKind> {
  static constexpr std::pair<const char*, MotionKind> words[] = {{"constant", MotionKind::constant},
                                                                 {"keyframes", MotionKind::keyframes}};
};

/// Where a moved body is at a time, relative to its initial pose.
struct MotionKey {
  double time = 0;                ///< [s]
  Vec3d translation = {0, 0, 0};  ///< [m]
  double angle = 0;               ///< [degrees]

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using K = MotionKey;
    visit(&K::time,
          FieldInfo{"time", "s", "Time of the pose, above that of the key before it", Range::positive()}.mandatory());
    visit(&K::translation, FieldInfo{"translation", "m", "Way of the centre since the start"});
    visit(&K::angle, FieldInfo{"angle", "degrees", "Turn about the axis since the start; whole turns count"});
  }
};

/// x -> rotation x + translation.
struct RigidMap {
  Mat3d rotation = Mat3d::identity();
  Vec3d translation = {0, 0, 0};  ///< [m]
  GRAUPEL_HD Vec3d operator()(const Vec3d& x) const { return rotation * x + translation; }
};

/// Turns are about `axis` through `center`, which the translation carries along.
struct Motion {
  MotionKind kind = MotionKind::constant;
  Vec3d velocity = {0, 0, 0};      ///< of the centre [m/s]
  double spin = 0;                 ///< about the axis [rad/s]
  double start_time = 0;           ///< [s]
  std::optional<double> end_time;  ///< [s]; then the body rests
  std::vector<MotionKey> keyframes;
  Vec3d axis = {0, 1, 0};       ///< any length but zero
  std::optional<Vec3d> center;  ///< [m]; default the body's position

  /// Translation [m] and angle [rad] since the start.
  void displacement(double time, Vec3d& translation, double& angle) const {
    if (kind == MotionKind::constant) {
      const double stop = end_time.value_or(std::numeric_limits<double>::infinity());
      const double moved = std::max(0.0, std::min(time, stop) - start_time);
      translation = moved * velocity;
      angle = moved * spin;
      return;
    }
    constexpr double degree = 3.14159265358979323846 / 180;
    const auto [before, after, fraction] = keys_around(MotionKey{}, keyframes, time);
    translation = before.translation + fraction * (after.translation - before.translation);
    angle = (before.angle + fraction * (after.angle - before.angle)) * degree;
  }

  /// Initial pose -> pose at `time`. `body_center` stands in for a center that is not given.
  RigidMap at(double time, const Vec3d& body_center) const {
    const Vec3d c = center.value_or(body_center);
    Vec3d translation;
    double angle;
    displacement(time, translation, angle);
    const Mat3d rotation = rotation_about(normalized(axis), angle);
    return {rotation, c + translation - rotation * c};
  }

  /// Largest speed of the centre [m/s] and largest angular speed [rad/s] at any time in [from, to].
  void fastest(double from, double to, double& speed, double& angular_speed) const {
    speed = angular_speed = 0;
    const auto raise = [&](double begin, double end, const Vec3d& v, double w) {
      if (end <= from || begin > to) return;
      speed = std::max(speed, norm(v));
      angular_speed = std::max(angular_speed, std::abs(w));
    };
    if (kind == MotionKind::constant)
      return raise(start_time, end_time.value_or(std::numeric_limits<double>::infinity()), velocity, spin);
    constexpr double degree = 3.14159265358979323846 / 180;
    MotionKey before;
    for (const MotionKey& key : keyframes) {
      const double rate = 1 / (key.time - before.time);
      raise(before.time, key.time, rate * (key.translation - before.translation),
            rate * (key.angle - before.angle) * degree);
      before = key;
    }
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using M = Motion;
    visit(&M::kind, FieldInfo{"kind", "", "How the motion is given"});
    visit(&M::velocity, FieldInfo{"velocity", "m/s", "Velocity of the centre"}.only_in("constant"));
    visit(&M::spin, FieldInfo{"spin", "rad/s", "Rate of turn about the axis"}.only_in("constant"));
    visit(&M::start_time,
          FieldInfo{"start_time", "s", "When the motion starts", Range::not_negative()}.only_in("constant"));
    visit(&M::end_time,
          FieldInfo{"end_time", "s", "When it stops; default never", Range::not_negative()}.only_in("constant"));
    visit(&M::keyframes,
          FieldInfo{"keyframes", "", "Poses in the order of time, after the initial one at time 0"}.mandatory().only_in(
              "keyframes"));
    visit(&M::axis, FieldInfo{"axis", "", "Axis of the turns"});
    visit(&M::center, FieldInfo{"center", "m", "Point of the axis; default the body's position"});
  }
};

}  // namespace graupel
