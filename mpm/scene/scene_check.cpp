#include "mpm/scene/scene_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <optional>

#include "core/scene/checks/plane_check.h"
#include "core/system/error.h"
#include "sparsegrid/analytic_shape.h"

namespace graupel::mpm {

namespace {

std::string text_of(const Vec3d& x) { return fmt::format("({:.5g}, {:.5g}, {:.5g})", x[0], x[1], x[2]); }

std::string name_of_source(const Scene& scene, int32_t index) {
  const auto s = static_cast<std::size_t>(index);
  if (s >= scene.sources.size()) {
    const std::size_t e = s - scene.sources.size();
    return fmt::format("emitter {0} (/emitters/{0}, {1} of '{2}')", e, word_of(scene.emitters[e].shape),
                       scene.emitters[e].material);
  }
  const Source& source = scene.sources[s];
  return fmt::format("source {0} (/sources/{0}, {1} of '{2}')", index, word_of(source.shape), source.material);
}

/// Such particles go where their script leads them, through obstacles too: a `stick` obstacle around them fixes the
/// nodes that hold what is attached to them.
bool always_kinematic(const SampledParticles& particles, std::size_t i) {
  if (particles.script.empty() || particles.script[i] < 0) return false;
  return std::isinf(particles.scripts[static_cast<std::size_t>(particles.script[i])].release_time);
}

/// Follows every led particle at 64 times of its script and at its keyframes.
void check_scripts(const Scene& scene, const SampledParticles& particles) {
  if (particles.scripts.empty()) return;
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  const double end = static_cast<double>(scene.frames) * scene.frame_time, tolerance = 1e-6 * scene.domain.dx;
  for (std::size_t s = 0; s < particles.scripts.size(); ++s) {
    const Script& script = particles.scripts[s];
    const double last = std::min(end, script.release_time);
    std::vector<double> times;
    for (int i = 1; i <= 64; ++i) times.push_back(last * i / 64);
    for (const MotionKey& key : script.motion.keyframes)
      if (key.time <= last) times.push_back(key.time);
    for (const double time : times) {
      const RigidMap pose = script.motion.at(time, script.body_center);
      for (std::size_t i = 0; i < particles.position.size(); ++i) {
        if (particles.script[i] != static_cast<int32_t>(s)) continue;
        const Vec3d x = pose(particles.position[i]);
        for (int d = 0; d < scene.domain.axes(); ++d)
          if (!(x[d] >= low[d] - tolerance && x[d] <= high[d] + tolerance))
            throw ConfigError(
                fmt::format("the motion of {} leads particles out of the walls (to {} at {:.4g} s, allowed: {} to {}). "
                            "Shorten it or "
                            "enlarge the domain",
                            script.name, text_of(x), time, text_of(low), text_of(high)));
      }
    }
  }
}

/// Loads that start with the run; those that start later find what is there then.
void check_first_loads(const Scene& scene, const SampledParticles& particles) {
  const auto carries = [&](const Load& load, std::size_t i) {
    const bool led = !particles.script.empty() && particles.script[i] >= 0 &&
                     particles.scripts[static_cast<std::size_t>(particles.script[i])].release_time > 0;
    const bool unborn = !particles.birth_time.empty() && particles.birth_time[i] > 0;
    const auto& material = particles.material_names[static_cast<std::size_t>(particles.material[i])];
    return !led && !unborn && scene.materials.at(material).model != MaterialModel::stationary &&
           norm2(particles.position[i] - load.place) <= load.radius * load.radius;
  };
  for (std::size_t l = 0; l < scene.loads.size(); ++l) {
    const TimedLoad& load = scene.loads[l];
    bool any = load.start > 0;
    for (std::size_t i = 0; !any && i < particles.position.size(); ++i) any = carries(load, i);
    if (!any)
      throw ConfigError(fmt::format(
          "load {0} (/loads/{0}) starts at 0 s where there is no matter that can move (place {1}, radius {2:.4g} m). "
          "Move it, give it a larger radius, or start it later",
          l, text_of(load.place), load.radius));
  }
}

bool meets(const Domain& domain, const Vec3d& low, const Vec3d& high) {
  bool meets = true;
  for (int d = 0; d < domain.axes(); ++d)
    meets = meets && low[d] <= domain.origin[d] + domain.size[d] && high[d] >= domain.origin[d];
  return meets;
}

/// Whether the line from `from` to `to` meets the domain, enlarged by `reach` [m] on each side.
bool line_meets(const Domain& domain, double reach, const Vec3d& from, const Vec3d& to) {
  double enters = 0, leaves = 1;  // parts of the line
  for (int d = 0; d < domain.axes(); ++d) {
    const double low = domain.origin[d] - reach, high = domain.origin[d] + domain.size[d] + reach;
    const double way = to[d] - from[d];
    if (way == 0 && !(from[d] >= low && from[d] <= high)) return false;
    if (way == 0) continue;
    const double a = (low - from[d]) / way, b = (high - from[d]) / way;
    enters = std::max(enters, std::min(a, b));
    leaves = std::min(leaves, std::max(a, b));
  }
  return enters <= leaves;
}

/// Whether the script ever leads the obstacle into the domain, also after the run: that may be a short trial. Looks at
/// a ball about the centre of its turns that holds the obstacle; between the script's times it moves along lines.
bool comes_into(const Domain& domain, const Obstacle& obstacle, double radius) {
  constexpr double late = 1e6;  // [s]
  const Motion& motion = *obstacle.motion;
  std::vector<double> times = {0, motion.start_time, motion.end_time.value_or(late)};
  if (motion.kind == MotionKind::keyframes) {
    times = {0};
    for (const MotionKey& key : motion.keyframes) times.push_back(key.time);
  }
  const auto center_at = [&](double time) {
    Vec3d translation;
    double angle;
    motion.displacement(time, translation, angle);
    return motion.center.value_or(obstacle.position) + translation;
  };
  for (std::size_t i = 0; i + 1 < times.size(); ++i)
    if (line_meets(domain, radius, center_at(times[i]), center_at(times[i + 1]))) return true;
  return false;
}

[[noreturn]] void refuse_outside(const Scene& scene, std::size_t i) {
  const Obstacle& obstacle = scene.obstacles[i];
  throw ConfigError(fmt::format(
      "obstacle {0} (/obstacles/{0}, {1}) lies outside the domain{2} (position {3}, domain: {4} to {5}). Move it, or "
      "leave it out",
      i, word_of(obstacle.shape), obstacle.motion ? ", and its motion does not lead it there" : "",
      text_of(obstacle.position), text_of(scene.domain.origin), text_of(scene.domain.origin + scene.domain.size)));
}

}  // namespace

void check_shapes_of_obstacles(const Scene& scene) {
  const Vec3d margin = Vec3d::filled(2 * scene.voxel());  // that of a level set's box
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    const Obstacle& obstacle = scene.obstacles[i];
    if (!sparsegrid::is_analytic(obstacle.shape) || obstacle.shape == Shape::plane || obstacle.motion) continue;
    const auto [low, high] = sparsegrid::analytic_bounds(obstacle);
    Vec3d world_low = Vec3d::filled(1e300), world_high = Vec3d::filled(-1e300);
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3d x = obstacle.to_world(
          {corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1], corner & 4 ? high[2] : low[2]});
      for (int d = 0; d < 3; ++d) {
        world_low[d] = std::min(world_low[d], x[d]);
        world_high[d] = std::max(world_high[d], x[d]);
      }
    }
    if (!meets(scene.domain, world_low - margin, world_high + margin)) refuse_outside(scene, i);
  }
}

void check_obstacles(const Scene& scene, const sparsegrid::ObstacleSet& obstacles) {
  const std::vector<sparsegrid::ObstacleView> views = obstacles.views_at(0);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Obstacle& obstacle = scene.obstacles[i];
    if (obstacle.shape == Shape::plane || meets(scene.domain, views[i].exact.solid_low, views[i].exact.solid_high))
      continue;
    if (obstacle.motion && comes_into(scene.domain, obstacle,
                                      obstacles.largest_distance(static_cast<int>(i),
                                                                 obstacle.motion->center.value_or(obstacle.position))))
      continue;
    refuse_outside(scene, i);
  }
}

void check_plane(const Scene& scene) {
  if (scene.domain.dimensions != 2 && scene.domain.dimensions != 3)
    throw ConfigError(fmt::format("domain.dimensions must be 2 or 3 ({})", scene.domain.dimensions));
  const auto out = first_out_of_plane(scene);
  if (!out) return;
  throw ConfigError(fmt::format("{} {}. {}", fmt::join(out->path, "."), out->problem, out->remedy));
}

namespace {

/// When the source or emitter sends out its first particle [s].
double first_time(const Scene& scene, std::size_t source) {
  if (source < scene.sources.size()) return 0;
  const Emitter& emitter = scene.emitters[source - scene.sources.size()];
  if (emitter.emission == Emission::stream) return emitter.start_time;
  return emitter.times.empty() ? 0 : emitter.times.front();
}

/// Obstacles where they are when each source or emitter begins.
class FirstObstacles {
 public:
  FirstObstacles(const Scene& scene, const sparsegrid::ObstacleSet& at_start) : at_start_(at_start) {
    for (std::size_t s = 0; s < scene.sources.size() + scene.emitters.size(); ++s) {
      const double time = scene.has_moving_obstacles() ? first_time(scene, s) : 0;
      later_.push_back(time > 0 ? std::optional(at_start.at(time)) : std::nullopt);
    }
  }
  const sparsegrid::ObstacleSet& of(int32_t source) const {
    const auto& later = later_[static_cast<std::size_t>(source)];
    return later ? *later : at_start_;
  }

 private:
  const sparsegrid::ObstacleSet& at_start_;
  std::vector<std::optional<sparsegrid::ObstacleSet>> later_;
};

}  // namespace

void check_start(const Scene& scene, const SampledParticles& particles, const sparsegrid::ObstacleSet& obstacles) {
  if (particles.position.empty())
    throw ConfigError("the scene has no particles. Add a source, or make one larger than a grid cell");
  check_obstacles(scene, obstacles);
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  const double tolerance = 1e-6 * scene.domain.dx;
  const FirstObstacles first_obstacles(scene, obstacles);
  for (std::size_t i = 0; i < particles.position.size(); ++i) {
    const Vec3d& x = particles.position[i];
    for (int d = 0; d < scene.domain.axes(); ++d)
      if (!(x[d] >= low[d] - tolerance && x[d] <= high[d] + tolerance))
        throw ConfigError(
            fmt::format("{} reaches outside the walls (particle at {}, allowed: {} to {}). Move or shrink it, or "
                        "enlarge the domain",
                        name_of_source(scene, particles.source[i]), text_of(x), text_of(low), text_of(high)));
    if (obstacles.count() == 0 || always_kinematic(particles, i)) continue;
    int nearest = -1;
    const double phi = first_obstacles.of(particles.source[i]).sample(x, &nearest).phi;
    if (phi >= -1e-4 * scene.domain.dx) continue;
    const double time = first_time(scene, static_cast<std::size_t>(particles.source[i]));
    throw ConfigError(fmt::format(
        "{0} overlaps obstacle {1} (/obstacles/{1}, {2}){5}: particle at {3} lies {4:.3g} m inside. Move the source or "
        "the obstacle",
        name_of_source(scene, particles.source[i]), nearest, word_of(scene.obstacles[nearest].shape), text_of(x), -phi,
        time > 0 && scene.obstacles[nearest].motion ? fmt::format(" at {:.4g} s, when it begins", time) : ""));
  }
  check_scripts(scene, particles);
  check_first_loads(scene, particles);
}

}  // namespace graupel::mpm
