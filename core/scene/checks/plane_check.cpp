#include "core/scene/checks/plane_check.h"

#include <cmath>
#include <cstdio>

namespace graupel {

namespace {

std::string text_of(const Vec3d& v) {
  char text[96];
  std::snprintf(text, sizeof(text), "([%.6g, %.6g, %.6g])", v[0], v[1], v[2]);
  return text;
}

class Search {
 public:
  std::optional<OutOfPlane> found;

  void velocity(const Vec3d& v, std::vector<std::string> path) {
    if (v[2] != 0)
      report(std::move(path), "leads out of the plane of a scene with two dimensions " + text_of(v),
             "Set its third component to 0, or domain.dimensions to 3");
  }

  void spin(const Vec3d& w, std::vector<std::string> path) {
    if (w[0] != 0 || w[1] != 0)
      report(std::move(path), "turns out of the plane of a scene with two dimensions " + text_of(w),
             "Leave only the third component, or set domain.dimensions to 3");
  }

  void motion(const Motion& motion, const std::vector<std::string>& path) {
    const auto in = [&](std::vector<std::string> keys) {
      keys.insert(keys.begin(), path.begin(), path.end());
      return keys;
    };
    bool turns = motion.kind == MotionKind::constant && motion.spin != 0;
    if (motion.kind == MotionKind::constant) velocity(motion.velocity, in({"velocity"}));
    for (std::size_t k = 0; motion.kind == MotionKind::keyframes && k < motion.keyframes.size(); ++k) {
      turns = turns || motion.keyframes[k].angle != 0;
      velocity(motion.keyframes[k].translation, in({"keyframes", std::to_string(k), "translation"}));
    }
    if (turns && (motion.axis[0] != 0 || motion.axis[1] != 0))
      report(in({"axis"}), "turns out of the plane of a scene with two dimensions " + text_of(motion.axis),
             "Use the axis [0, 0, 1], or set domain.dimensions to 3");
  }

 private:
  void report(std::vector<std::string> path, std::string problem, std::string remedy) {
    if (!found) found = OutOfPlane{std::move(path), std::move(problem), std::move(remedy)};
  }
};

}  // namespace

std::optional<OutOfPlane> first_out_of_plane(const Scene& scene) {
  if (!scene.domain.is_plane()) return {};
  Search search;
  search.velocity(scene.gravity, {"gravity"});
  for (std::size_t i = 0; i < scene.gravity_keyframes.size(); ++i)
    search.velocity(scene.gravity_keyframes[i].gravity, {"gravity_keyframes", std::to_string(i), "gravity"});
  for (std::size_t i = 0; i < scene.loads.size(); ++i)
    search.velocity(scene.loads[i].force, {"loads", std::to_string(i), "force"});
  for (std::size_t i = 0; i < scene.sources.size(); ++i) {
    const Source& source = scene.sources[i];
    const std::string index = std::to_string(i);
    search.velocity(source.velocity, {"sources", index, "velocity"});
    search.spin(source.angular_velocity, {"sources", index, "angular_velocity"});
    if (source.motion) search.motion(*source.motion, {"sources", index, "motion"});
  }
  for (std::size_t i = 0; i < scene.kinematic_regions.size(); ++i)
    search.motion(scene.kinematic_regions[i].motion, {"kinematic_regions", std::to_string(i), "motion"});
  for (std::size_t i = 0; i < scene.emitters.size(); ++i)
    search.velocity(scene.emitters[i].velocity, {"emitters", std::to_string(i), "velocity"});
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i)
    if (scene.obstacles[i].motion)
      search.motion(*scene.obstacles[i].motion, {"obstacles", std::to_string(i), "motion"});
  return search.found;
}

}  // namespace graupel
