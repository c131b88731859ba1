// Owns the obstacles' grids and the views over them; everything here works on NanoVDB bytes. Sets that hold the same
// body share its grid: a solver, another one and a network's environment are made of one scene.
#include "sparsegrid/obstacle_set.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>

#include "core/parallel/buffer.h"
#include "core/parallel/memory.h"
#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "sparsegrid/level_set_grid.h"
#include "sparsegrid/obstacle_checks.h"

namespace graupel::sparsegrid {

namespace {

/// x_world = rotation x_local + position.
struct Pose {
  Mat3d rotation;
  Vec3d position;
  Vec3d operator()(const Vec3d& local) const { return rotation * local + position; }
};

Pose pose_at(const Obstacle& obstacle, double time) {
  const Pose start = {obstacle.rotation(), obstacle.position};
  if (!obstacle.motion) return start;
  const RigidMap moved = obstacle.motion->at(time, obstacle.position);
  return {moved.rotation * start.rotation, moved(start.position)};
}

Vec3d corner_of(const LocalBox& box, int corner) {
  Vec3d x;
  for (int d = 0; d < 3; ++d) x[d] = corner >> d & 1 ? box.high[d] : box.low[d];
  return x;
}

/// World box of a local box under the pose.
LocalBox to_world_box(const Pose& pose, const LocalBox& local) {
  LocalBox box = {Vec3d::filled(1e30), Vec3d::filled(-1e30)};
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d x = pose(corner_of(local, corner));
    for (int d = 0; d < 3; ++d) {
      box.low[d] = std::min(box.low[d], x[d]);
      box.high[d] = std::max(box.high[d], x[d]);
    }
  }
  return box;
}

/// World box of the points with local y <= level: bounded only where the plane is square to an axis.
LocalBox below_plane(const Pose& pose, double level) {
  LocalBox box = {Vec3d::filled(-1e30), Vec3d::filled(1e30)};
  const Vec3d up = pose({0, 1, 0}) - pose.position;
  for (int d = 0; d < 3; ++d) {
    if (up[d] > 1 - 1e-14) box.high[d] = pose.position[d] + level;
    if (up[d] < -1 + 1e-14) box.low[d] = pose.position[d] - level;
  }
  return box;
}

/// Adds what both boxes share, if anything.
void add_shared(const LocalBox& a, LocalBox b, std::vector<LocalBox>& boxes) {
  for (int d = 0; d < 3; ++d) {
    b.low[d] = std::max(a.low[d], b.low[d]);
    b.high[d] = std::min(a.high[d], b.high[d]);
    if (b.low[d] > b.high[d]) return;
  }
  boxes.push_back(b);
}

void set_pose(ObstacleView& view, const Pose& pose, const LevelSetGrid& level_set) {
  ObstacleFrame<double> frame = view.exact;
  const double voxel = 1 / frame.inverse_voxel;
  frame.rotation = pose.rotation;
  frame.position = pose.position;
  const LocalBox near = view.is_plane ? below_plane(pose, frame.band + voxel) : to_world_box(pose, level_set.near);
  const LocalBox solid = view.is_plane ? below_plane(pose, voxel) : to_world_box(pose, level_set.solid);
  frame.low = near.low, frame.high = near.high;
  frame.solid_low = solid.low, frame.solid_high = solid.high;
  view.set_frame(frame);
}

ObstacleView view_of(const Obstacle& obstacle, const LevelSetGrid& level_set, double voxel, double band) {
  ObstacleView view{};
  view.grid = obstacle.shape == Shape::plane ? nullptr : level_set.grid();
  view.exact.inverse_voxel = 1 / voxel;
  view.exact.band = static_cast<double>(static_cast<float>(band));  // as stored in the grid
  view.contact = obstacle.contact;
  view.friction = obstacle.friction;
  view.is_plane = obstacle.shape == Shape::plane;
  set_pose(view, pose_at(obstacle, 0), level_set);
  return view;
}

std::string words_of(Shape shape) {
  for (const auto& [word, value] : EnumWords<Shape>::words)
    if (value == shape) return word;
  return "";
}

/// Whether one voxel alone is inside, given their box and one voxel around it.
bool lies_in_a_voxel(const LocalBox& solid, double voxel) {
  const Vec3d extent = solid.high - solid.low;
  return std::max({extent[0], extent[1], extent[2]}) < 2.5 * voxel;
}

/// Why matter would not feel the body, or null: foils and needles too, whose faces lie between the voxels' centres.
const char* fault_of(const LevelSetGrid& grid, double voxel) {
  if (grid.solid.low[0] > grid.solid.high[0]) return " has no inside";
  if (lies_in_a_voxel(grid.solid, voxel)) return " is smaller than two voxels";
  return grid.facts.min_value > -0.05 * voxel ? " is thinner than a tenth of a voxel" : nullptr;
}

/// The floats next to `x` that are not above it, not below it.
float round_down(double x) {
  const auto rounded = static_cast<float>(x);
  return static_cast<double>(rounded) > x ? std::nextafter(rounded, -INFINITY) : rounded;
}
float round_up(double x) { return -round_down(-x); }

/// The voxels of a box and some around it; how many they are.
double voxels_of(const LocalBox& around, double voxel, int margin, DenseValues& box) {
  double count = 1;
  for (int d = 0; d < 3; ++d) {
    box.low[d] = static_cast<int>(std::floor(around.low[d] / voxel)) - margin;
    box.size[d] = static_cast<int>(std::ceil(around.high[d] / voxel)) + margin + 1 - box.low[d];
    count *= box.size[d];
  }
  return count;
}

using SharedGrid = std::shared_ptr<const LevelSetGrid>;

/// Grids of analytic bodies that some set holds. A file may have changed since it was read, so that those are made
/// anew.
class SharedGrids {
 public:
  template <typename Make>
  SharedGrid get(const Scene& scene, const Obstacle& body, const Make& make) {
    if (body.mesh || !body.file.empty()) return std::make_shared<const LevelSetGrid>(make());
    const Key key = {shape_key(body), scene.voxel(), scene.band()};
    {
      const std::lock_guard lock(mutex_);
      const auto found = grids_.find(key);
      if (found != grids_.end())
        if (SharedGrid known = found->second.lock()) return known;
    }
    auto made = std::make_shared<const LevelSetGrid>(make());
    const std::lock_guard lock(mutex_);
    if (grids_.size() >= most_) {
      std::erase_if(grids_, [](const auto& one) { return one.second.expired(); });
      most_ = std::max<std::size_t>(64, 2 * grids_.size());
    }
    std::weak_ptr<const LevelSetGrid>& kept = grids_[key];
    if (SharedGrid known = kept.lock()) return known;  // of a thread that was first
    kept = made;
    return made;
  }

 private:
  using Key = std::tuple<ShapeKey, double, double>;

  std::mutex mutex_;
  std::map<Key, std::weak_ptr<const LevelSetGrid>> grids_;
  std::size_t most_ = 64;  ///< until those that nobody holds any more are dropped
};

SharedGrids& shared_grids() {
  static SharedGrids grids;
  return grids;
}

}  // namespace

void ObstacleView::set_frame(const ObstacleFrame<double>& frame) {
  exact = frame;
  single.rotation = frame.rotation.cast<float>();
  single.position = frame.position.cast<float>();
  single.inverse_voxel = static_cast<float>(frame.inverse_voxel);
  single.band = static_cast<float>(frame.band);
  for (int d = 0; d < 3; ++d) {
    single.low[d] = round_down(frame.low[d]);
    single.high[d] = round_up(frame.high[d]);
    single.solid_low[d] = round_down(frame.solid_low[d]);
    single.solid_high[d] = round_up(frame.solid_high[d]);
  }
}

std::vector<float> dense_values(const LevelSetGrid& level_set, double voxel, DenseValues& box) {
  double count = voxels_of(level_set.near, voxel, 1, box);
  if (count > most_dense_voxels) count = voxels_of(level_set.solid, voxel, 3, box);
  std::vector<float> values;
  if (count > most_dense_voxels) return values;
  values.reserve(static_cast<std::size_t>(count));
  const auto accessor = level_set.grid()->getAccessor();
  for (int x = 0; x < box.size[0]; ++x)
    for (int y = 0; y < box.size[1]; ++y)
      for (int z = 0; z < box.size[2]; ++z)
        values.push_back(accessor.getValue(nanovdb::Coord(box.low[0] + x, box.low[1] + y, box.low[2] + z)));
  return values;
}

struct ObstacleSet::Impl {
  Scene scene;                     ///< domain and obstacles; for planes, whose grids are made when asked for
  std::vector<std::string> names;  ///< [count]
  std::vector<SharedGrid> grids;   ///< [count]; without bytes for a plane
  Buffer<ObstacleView> views{Device::cpu, 0};
  ObstacleLists lists;

  mutable std::once_flag uploaded;
  mutable std::vector<Buffer<char>> cuda_grids;
  mutable std::vector<Buffer<float>> cuda_dense;
  mutable Buffer<ObstacleView> cuda_views;
  mutable std::vector<ObstacleView> cuda_views_on_host;
  mutable Buffer<int32_t> cuda_list_begin{Device::cuda, 0}, cuda_list_place{Device::cuda, 0};

  explicit Impl(const Scene& from);
  /// The same bodies at another time.
  Impl(const Impl& bodies, double time);
  void build_grids();
  SharedGrid grid_of(std::size_t i) const;
  LevelSetGrid solid_grid(std::size_t i) const;
  void upload() const;
  LevelSetGrid plane_grid(int i) const { return build_level_set(scene, scene.obstacles[i], names[i]); }
};

ObstacleSet::Impl::Impl(const Scene& from) {
  scene.domain = from.domain;
  scene.obstacles = from.obstacles;
  scene.obstacle_voxel = from.voxel();
  scene.obstacle_band = from.band();
  if (from.voxel() < smallest_voxel)
    throw ConfigError("obstacle_voxel is too small (" + std::to_string(from.voxel() * 1e6) +
                      "e-6 m, at least 20e-6 m). Choose a larger one");
  if (!scene.obstacles.empty() && from.band() < 2 * from.voxel())
    throw ConfigError("obstacle_band is too narrow (" + std::to_string(from.band()) + " m, at least two voxels of " +
                      std::to_string(from.voxel()) + " m). Widen the band or lower obstacle_voxel");
  for (const Obstacle& obstacle : scene.obstacles)
    names.push_back("obstacle_" + std::to_string(names.size()) + "_" + words_of(obstacle.shape));
  build_grids();
  std::vector<ObstacleView> host;
  for (std::size_t i = 0; i < grids.size(); ++i)
    host.push_back(view_of(scene.obstacles[i], *grids[i], from.voxel(), from.band()));
  views.upload(host);
  std::vector<bool> moves;
  for (const Obstacle& obstacle : scene.obstacles) moves.push_back(obstacle.motion.has_value());
  lists = list_obstacles(host, moves, scene.domain.origin, scene.domain.origin + scene.domain.size);
}

ObstacleSet::Impl::Impl(const Impl& bodies, double time)
    : scene(bodies.scene), names(bodies.names), grids(bodies.grids), lists(bodies.lists) {
  std::vector<ObstacleView> placed = bodies.views.download();
  for (std::size_t i = 0; i < placed.size(); ++i) set_pose(placed[i], pose_at(scene.obstacles[i], time), *grids[i]);
  views.upload(placed);
}

void ObstacleSet::Impl::build_grids() {
  check_grids_fit(scene, static_cast<double>(available_bytes(Device::cpu)));
  grids.resize(scene.obstacles.size());
  // The first obstacle's error is told: those behind one that has failed are not built any more.
  std::atomic<std::size_t> first_failed = grids.size();
  for_each_pool_task(grids.size(), [&](std::size_t i) {
    if (i > first_failed) return;
    try {
      grids[i] = grid_of(i);
    } catch (...) {
      std::size_t first = first_failed;
      while (i < first && !first_failed.compare_exchange_weak(first, i)) {
      }
      throw;
    }
  });
}

SharedGrid ObstacleSet::Impl::grid_of(std::size_t i) const {
  if (scene.obstacles[i].shape == Shape::plane) return std::make_shared<const LevelSetGrid>();
  return shared_grids().get(scene, scene.obstacles[i], [&] { return solid_grid(i); });
}

LevelSetGrid ObstacleSet::Impl::solid_grid(std::size_t i) const {
  const Obstacle& obstacle = scene.obstacles[i];
  if (obstacle.shape == Shape::points)
    throw ConfigError(names[i] + ": points have no surface. Use a mesh or a .vdb level set as an obstacle");
  LevelSetGrid grid = build_level_set(scene, obstacle, names[i]);
  const char* fault = fault_of(grid, scene.voxel());
  if (fault != nullptr)
    throw ConfigError(names[i] + fault + " on its grid (voxel " + std::to_string(scene.voxel()) +
                      " m). Make it thicker than two voxels (is its scale right?) or lower obstacle_voxel");
  return grid;
}

void ObstacleSet::Impl::upload() const {
  std::vector<ObstacleView> device_views = views.download();
  cuda_views = Buffer<ObstacleView>(Device::cuda, device_views.size());
  for (std::size_t i = 0; i < grids.size(); ++i) {
    Buffer<char> bytes(Device::cuda, grids[i]->bytes.size());
    device_copy(Device::cuda, bytes.data(), Device::cpu, grids[i]->bytes.data(), grids[i]->bytes.size());
    device_views[i].grid = reinterpret_cast<const nanovdb::FloatGrid*>(bytes.data());
    cuda_grids.push_back(std::move(bytes));
    if (device_views[i].is_plane) continue;
    Buffer<float> dense(Device::cuda, 0);
    dense.upload(dense_values(*grids[i], 1 / device_views[i].exact.inverse_voxel, device_views[i].dense));
    device_views[i].dense.values = dense.size() > 0 ? dense.data() : nullptr;
    cuda_dense.push_back(std::move(dense));
  }
  cuda_views.upload(device_views);
  cuda_views_on_host = std::move(device_views);
  cuda_list_begin.upload(lists.begin);
  cuda_list_place.upload(lists.place);
}

ObstacleSet::ObstacleSet(const Scene& scene) : impl_(std::make_shared<Impl>(scene)) {}

ObstacleSet ObstacleSet::at(double time) const {
  ObstacleSet placed;
  if (impl_) placed.impl_ = std::make_shared<Impl>(*impl_, time);
  return placed;
}

int ObstacleSet::count() const { return impl_ ? static_cast<int>(impl_->names.size()) : 0; }

ObstacleSetView ObstacleSet::view(Device device) const {
  if (count() == 0) return {nullptr, 0};
  const ObstacleCells lists = cells(device);
  return {device == Device::cpu ? impl_->views.data() : impl_->cuda_views.data(), count(), lists};
}

ObstacleCells ObstacleSet::cells(Device device) const {
  if (count() == 0) return {};
  const ObstacleLists& lists = impl_->lists;
  if (device == Device::cuda) std::call_once(impl_->uploaded, [this] { impl_->upload(); });
  ObstacleCells cells = lists.cells;
  if (lists.begin.empty()) return cells;
  cells.begin = device == Device::cpu ? lists.begin.data() : impl_->cuda_list_begin.data();
  cells.place = device == Device::cpu ? lists.place.data() : impl_->cuda_list_place.data();
  return cells;
}

std::vector<ObstacleView> ObstacleSet::views_at(double time, Device device) const {
  if (count() == 0) return {};
  view(device);
  std::vector<ObstacleView> views = device == Device::cpu ? impl_->views.download() : impl_->cuda_views_on_host;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (impl_->scene.obstacles[i].motion)
      set_pose(views[i], pose_at(impl_->scene.obstacles[i], time), *impl_->grids[i]);
  return views;
}

double ObstacleSet::largest_distance(int obstacle, const Vec3d& from) const {
  const auto i = static_cast<std::size_t>(obstacle);
  const Obstacle& body = impl_->scene.obstacles[i];
  const LocalBox box = body.shape == Shape::plane ? plane_bounds(body, impl_->scene.domain) : impl_->grids[i]->solid;
  double largest = 0;
  for (int corner = 0; corner < 8; ++corner)
    largest = std::max(largest, norm(pose_at(body, 0)(corner_of(box, corner)) - from));
  return largest;
}

SignedDistance<double> ObstacleSet::sample(const Vec3d& x, int* nearest) const {
  int index = -1;
  const auto result = signed_distance(view(), x, index);
  if (nearest != nullptr) *nearest = index;
  return result;
}

GridFacts ObstacleSet::facts(int obstacle) const {
  const LevelSetGrid& grid = *impl_->grids.at(static_cast<std::size_t>(obstacle));
  GridFacts facts = grid.bytes.size() > 0 ? grid.facts : impl_->plane_grid(obstacle).facts;
  facts.name = impl_->names[static_cast<std::size_t>(obstacle)];  // bodies that share a grid have names of their own
  return facts;
}

void ObstacleSet::write_vdb(const std::string& path) const {
  if (count() == 0) throw ConfigError("there is no obstacle to write to '" + path + "'. Add one to the scene");
  const Domain& domain = impl_->scene.domain;
  const double voxel = impl_->scene.voxel(), band = impl_->scene.band();
  const LocalBox inner = {domain.origin, domain.origin + domain.size};
  // Where a plane's body is closed: at its band's distance outside the domain, whose values stay.
  const Vec3d margin = Vec3d::filled(band + voxel);
  const LocalBox outer = {inner.low - margin, inner.high + margin};
  std::vector<LevelSetGrid> planes(impl_->grids.size());
  std::vector<const LevelSetGrid*> grids;
  UnionRequest request{[this](const Vec3d& x) { return sample(x).phi; }, {}, {}, {}, voxel, band};
  for (int i = 0; i < count(); ++i) {
    const LevelSetGrid& own = *impl_->grids[i];
    const Obstacle& obstacle = impl_->scene.obstacles[i];
    const bool is_plane = own.bytes.size() == 0;
    if (is_plane) planes[i] = build_plane_body(impl_->scene, obstacle, impl_->names[i]);
    grids.push_back(is_plane ? &planes[i] : &own);
    const Pose pose = pose_at(obstacle, 0);
    add_shared(is_plane ? outer : inner, to_world_box(pose, grids.back()->near), request.boxes);
    if (is_plane) add_shared(outer, below_plane(pose, 0), request.insides);
  }
  if (!request.insides.empty()) request.border = outer;
  write_level_sets(path, grids, impl_->names, request);
}

}  // namespace graupel::sparsegrid
