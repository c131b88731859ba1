#include "mpm/gpu/small/frame_tables.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "mpm/physics/equal_substeps.h"
#include "mpm/solver/time_step.h"

namespace graupel::mpm {

namespace {

/// The nodes within two cells of the solid, as within_reach() has them.
NodeBox box_of(const sparsegrid::ObstacleView& obstacle, const GridGeometry<float, 3>& grid, int64_t first) {
  NodeBox box{{0, 0, 0}, {0, 0, 0}, static_cast<int32_t>(first)};
  for (int d = 0; d < 3; ++d) {
    const int nodes = block_width * grid.blocks[d];
    const auto node_at = [&](double x) {
      const double node = (x - static_cast<double>(grid.origin[d])) / static_cast<double>(grid.dx);
      return static_cast<int>(std::clamp(node, -1.0, static_cast<double>(nodes)));
    };
    const double reach = 2.01 * static_cast<double>(grid.dx);
    int high = nodes - 1;
    if (!obstacle.is_plane) {
      box.low[d] = std::max(0, node_at(obstacle.exact.solid_low[d] - reach));
      high = std::min(high, node_at(obstacle.exact.solid_high[d] + reach) + 1);
    }
    box.size[d] = std::max(0, high + 1 - box.low[d]);
  }
  return box;
}

constexpr std::size_t alignment = 16;

/// Room for `count` values at the end of what was laid out; its place.
template <typename T>
std::size_t place_for(std::size_t count, std::size_t& end) {
  const std::size_t place = (end + alignment - 1) / alignment * alignment;
  end = place + count * sizeof(T);
  return place;
}

}  // namespace

FrameTables::FrameTables(const std::vector<std::unique_ptr<SceneSetup<float>>>& scenes, Device device)
    : scenes_(scenes), tables_(device, 0), held_(device, 0) {
  constexpr double forever = std::numeric_limits<double>::infinity();
  for (const auto& s : scenes_) {
    check_scripted_speed(s->scene,
                         std::max(s->moving.largest_speed(0, forever), s->lifecycle.largest_speed(0, forever)));
    known_early_ = known_early_ && s->scene.time_step.policy == StepPolicy::fixed;
  }
}

/// `speed`: largest of its particles [m/s]. Times as Solver::advance_frame() has them, to the bit: they decide in which
/// substep a particle is born.
FrameTables::Frame FrameTables::frame_of(const SceneSetup<float>& s, int64_t frames_done, double speed) const {
  Frame frame;
  const double frame_time = s.scene.frame_time, from = static_cast<double>(frames_done) * frame_time;
  frame.substeps =
      static_cast<int32_t>(equal_substeps(s.scene.time_step, s.scene.domain.dx, frame_time, s.fastest(speed, from)));
  const double dt = frame_time / frame.substeps;
  double elapsed = 0;
  for (int32_t i = 0; i < frame.substeps; ++i, elapsed += dt) {
    if (s.lifecycle.has_presence()) frame.step_end.push_back(from + elapsed + dt);
    for (const ScriptStep<float>& script : s.lifecycle.script_steps(from + elapsed, dt))
      frame.scripts.push_back(script);
  }
  frame.carried = carried_affine<float>(s.scene.transfer, dt);
  if (!s.moving.any() || frame.substeps == 0) return frame;
  frame.obstacles = s.moving.substeps(from, dt, frame.substeps);
  const std::size_t obstacles = s.scene.obstacles.size();
  for (int32_t i = 0; i < frame.substeps; ++i) {
    int64_t nodes = 0;
    for (const int32_t moving : s.moving.index()) {
      frame.boxes.push_back(
          box_of(frame.obstacles.poses[static_cast<std::size_t>(i) * obstacles + static_cast<std::size_t>(moving)],
                 s.grid, nodes));
      nodes += frame.boxes.back().count();
    }
    frame.held = std::max(frame.held, nodes);
  }
  return frame;
}

void FrameTables::make(int64_t frames_done, const std::vector<SceneProgress>& controls) {
  if (made_for_ == frames_done) return;
  frames_.clear();
  for (std::size_t i = 0; i < scenes_.size(); ++i) {
    const ScenePhase phase = controls[i].phase;
    const bool ended = phase == ScenePhase::diverged || phase == ScenePhase::too_stiff;
    frames_.push_back(ended ? Frame{} : frame_of(*scenes_[i], frames_done, controls[i].speed));
  }
  made_for_ = frames_done;
}

void FrameTables::make_early(int64_t frames_done, const std::vector<SceneProgress>& controls) {
  if (known_early_) make(frames_done, controls);
}

bool FrameTables::upload() {
  struct Places {
    std::size_t poses, steps, boxes, step_end, scripts;
    int64_t held;
  };
  std::vector<Places> places;
  std::size_t end = scenes_.size() * sizeof(ChangingScene);
  int64_t held = 0;
  for (const Frame& f : frames_) {
    places.push_back({place_for<sparsegrid::ObstacleView>(f.obstacles.poses.size(), end),
                      place_for<RigidStep<float>>(f.obstacles.steps.size(), end),
                      place_for<NodeBox>(f.boxes.size(), end), place_for<double>(f.step_end.size(), end),
                      place_for<ScriptStep<float>>(f.scripts.size(), end), held});
    held += f.held;
  }
  const void *const tables = tables_.data(), *const contacts = held_.data();
  const auto with_room = [](std::size_t n, std::size_t present) { return n > present ? n + n / 4 : present; };
  tables_.resize_discard(with_room(end, tables_.size()));
  held_.resize_discard(with_room(2 * static_cast<std::size_t>(held), held_.size()));

  packed_.resize(tables_.size());
  const auto put = [&](std::size_t place, const auto& values) {
    if (!values.empty()) std::memcpy(packed_.data() + place, values.data(), values.size() * sizeof(values[0]));
  };
  const auto at = [&]<typename T>(std::size_t place, const std::vector<T>&) {
    return reinterpret_cast<const T*>(tables_.data() + place);
  };
  std::vector<ChangingScene> scenes;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const Frame& f = frames_[i];
    const Places& p = places[i];
    NodeContact* const first = held_.data() + p.held;
    scenes.push_back({f.substeps,
                      f.substeps > 0 ? static_cast<int32_t>(f.scripts.size()) / f.substeps : 0,
                      scenes_[i]->moving.view_of(at(p.poses, f.obstacles.poses), at(p.steps, f.obstacles.steps)),
                      at(p.boxes, f.boxes),
                      {first, first + held},
                      scenes_[i]->lifecycle.view(),
                      at(p.step_end, f.step_end),
                      at(p.scripts, f.scripts),
                      f.carried});
    put(p.poses, f.obstacles.poses);
    put(p.steps, f.obstacles.steps);
    put(p.boxes, f.boxes);
    put(p.step_end, f.step_end);
    put(p.scripts, f.scripts);
  }
  put(0, scenes);
  device_copy(tables_.device(), tables_.data(), Device::cpu, packed_.data(), end);
  discard();
  return tables != tables_.data() || contacts != held_.data();
}

}  // namespace graupel::mpm
