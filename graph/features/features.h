// Particle features of the HGN paper (section 3.1), shared by training and inference.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/scene/scene.h"
#include "graph/config/feature_config.h"
#include "graph/features/feature_row.h"
#include "graph/features/material_constants.h"
#include "graph/features/obstacle_particles.h"
#include "graph/features/swept_collision.h"
#include "sparsegrid/obstacle_normals.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::graph {

/// Moving obstacles at a time, for EnvironmentView.
struct EnvironmentPose {
  std::vector<sparsegrid::ObstacleView> obstacles;      ///< [obstacles]
  std::vector<RigidMap> carried_from;                   ///< [obstacles]
  std::vector<sparsegrid::CarriedNormalsView> normals;  ///< [obstacles that move]
};
/// The same in the memory of some device.
struct PoseView {
  const sparsegrid::ObstacleView* obstacles;
  const RigidMap* carried_from;
  const sparsegrid::CarriedNormalsView* normals;
};

/// The environment of a scene at one time, built once: obstacles, their cell normals and the walls.
struct Environment {
  /// At the start. In a scene with two dimensions obstacles are those parts of them that lie in its plane.
  /// `normal_spacing` [m] is the cell size of the obstacle normals, scene.domain.dx unless given. Throws ConfigError
  /// for periodic walls without a partner.
  explicit Environment(const Scene& scene, std::optional<double> normal_spacing = {});
  /// The same with the obstacles where their scripts have them at `time` [s]; shares their grids.
  Environment at(double time) const;
  /// Whether a script moves an obstacle.
  bool moves() const { return moving != nullptr; }
  /// Ways of the obstacles that move between two times [s].
  std::vector<ObstacleWay> ways_between(double from, double to) const;
  /// Where a point of an obstacle's surface was `seconds` before this environment's time.
  Vec3f point_before(const Vec3f& point, double seconds) const;
  /// Whether a wall is periodic.
  bool is_periodic() const { return period[0] > 0 || period[1] > 0 || period[2] > 0; }
  sparsegrid::ObstacleSet obstacles;
  sparsegrid::ObstacleNormals normals;
  ObstacleParticles obstacle_particles;
  double normal_spacing;        ///< [m]
  std::optional<double> plane;  ///< [m] z of all particles of a scene with two dimensions
  Vec3d wall_low, wall_high;    ///< [m] scene.domain.origin and origin + size: the AABB of the domain
  Vec3d hold_low, hold_high;    ///< [m] where the walls hold the material; far away at open and periodic walls
  Vec3d box_low, box_high;      ///< [m] Scene::wall_low/high: particles are in this box, or leave it by a wall
  Vec3d period;                 ///< [m] distance of the periodic walls of an axis; 0 for none
  Vec3f gravity_step;           ///< [m/frame^2] gravity times the square of the frame time
  double frame_time;            ///< [s]
  SurfaceContact wall[6];       ///< lower x y z, upper x y z
  MaterialTable materials;
  /// For kernels on `device`; valid as long as this lives and its time is not set. Where obstacles move, on the CPU
  /// alone.
  EnvironmentView view(Device device) const;
  /// What a pose of the moving obstacles changes of a view on `device`, in host memory.
  EnvironmentPose pose_at(double time, Device device) const;
  /// view(device) with a pose, whose arrays lie in the memory of the device.
  EnvironmentView view_of_pose(Device device, const PoseView& pose) const;
  /// Of obstacles that stay where they are placed.
  void set_time(double when);
  SweptCollision swept_collision(Device device) const;
  /// Origin of the grid of evaluation and rollouts: the domain's lower corner. In two dimensions the plane lies between
  /// the two lowest layers of cells, so that both see the same and the levels above have one.
  Vec3d grid_origin(double spacing) const;
  double way_piece;                     ///< [m] pieces in which project_out follows a particle's way past obstacles
  double time = 0;                      ///< [s]
  std::shared_ptr<const Scene> moving;  ///< domain and obstacles; null where none moves
  std::vector<RigidMap> carried_from;   ///< [obstacles] where each was a frame before; empty where none moves
};

/// The environment of a scene over time, rebuilt where obstacles have moved.
class MovingEnvironment {
 public:
  /// `start` must live as long as this.
  explicit MovingEnvironment(const Environment& start) : start_(start) {}
  /// At `time` [s], as Environment::at; `start` itself where nothing moves. Valid until the next call.
  const Environment& at(double time);

 private:
  const Environment& start_;
  std::optional<Environment> placed_;
};

/// Continuous features of each particle, without the type embedding, shape [n, input_width - embedding], row-major:
///   velocities v^n, v^{n-1}, .. (history x 3, newest first, normalised), cell normal (3, if used), distances to the
///   six faces of the domain (lower x y z, upper x y z; clamped to +-wall_clamp and divided by it), and, if used, the
///   obstacle distance (clamped, divided by distance_clamp) and its gradient (3; zero beyond the band), the constants
///   of the material (7; graph/features/material_constants.h) and the contact of the nearest surface (7;
///   write_contact).
/// `positions` holds history + 1 frames, newest last, each [n]; velocities are frame differences (dt = 1). `material`
/// [n] is of use to networks that see constants alone: indices into environment.materials, or no_material. The features
/// are those of the scene turned by `symmetry`.
std::vector<float> particle_features(const FeatureConfig& config, const Normalization& normalization,
                                     const Environment& environment, const std::vector<std::vector<Vec3f>>& positions,
                                     const std::vector<int32_t>& material = {}, const AxisMap& symmetry = {});

/// Row of the embedding table for a particle type id: 0..8 have their own, 13 (stationary) stationary_row. Throws
/// InputError for other ids.
int embedding_row(int32_t particle_type);
inline constexpr int embedding_rows = 9;

/// Moves particles out of obstacles and back inside the walls (in place); returns how many moved.
/// `before` holds the positions that the particles came from. From a free one, a particle stays on the side of an
/// obstacle that it came from, also when it would have passed through, and slides along the surface for the rest of its
/// way. Where obstacles move, `before` is of the time `since` [s], the environment's without it; a particle that meets
/// one comes from where that obstacle has carried it since.
int64_t project_out(const Environment& environment, const std::vector<Vec3f>& before, std::vector<Vec3f>& position,
                    std::optional<double> since = {});

/// Throws ConfigError for scenes that networks run but are not trained on: with scripted particles, periodic walls, and
/// planes in which obstacles move or particles come or go. Returns the scene.
const Scene& check_training_scene(const Scene& scene);

/// Moves particles back into the plane of a scene with two dimensions (in place).
void keep_in_plane(const Environment& environment, std::vector<Vec3f>& position);

}  // namespace graupel::graph
