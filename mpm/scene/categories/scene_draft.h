// A scene that is being drawn, and the pieces that categories compose: walls, materials, bodies, obstacles, streams.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/scene/recipes/category_recipe.h"
#include "mpm/scene/categories/bodies.h"
#include "mpm/scene/placement.h"

namespace graupel::mpm {

/// Part of the domain, as shares of the box inside the walls.
struct Part {
  Vec3d low = {0, 0, 0}, high = {1, 1, 1};
};

/// How a body is turned.
enum class Pose { free, upright };  // uniform in space, or about the vertical alone
/// Where a body is put.
enum class Place { anywhere, on_floor };

class SceneDraft {
 public:
  SceneDraft(const CategoryRecipe& recipe, Draws& draws);

  const CategoryRecipe& recipe;
  Draws& draws;
  Scene scene;

  Vec3d low() const { return scene.wall_low(); }
  Vec3d high() const { return scene.wall_high(); }
  double run_time() const { return static_cast<double>(scene.frames) * scene.frame_time; }
  Vec3d point_in(const Part& part) const;

  /// Draws the scene's materials, the first of one of `models` (any where empty), each with constants of its own.
  void draw_materials(const std::vector<MaterialModel>& models);
  /// One of the scene's materials of one of `models` (any where empty).
  std::string material(const std::vector<MaterialModel>& models = {});

  /// Gives the budget of particles (all of it, or what fits `volume` [m^3]) to n bodies and streams, in random shares.
  void share_particles(int64_t n);
  void share_particles(int64_t n, double volume);
  /// The next share, in particles; 0 where all are taken.
  double take_share();

  /// A body of a drawn shape and size at rest, small enough for the next share of particles; none where the
  /// smallest one has more.
  std::optional<Source> body(Pose pose);
  std::optional<Source> body(Pose pose, const std::vector<Shape>& shapes, const Interval& sizes);
  /// A box that is not turned, of two shares of particles; large, as columns are.
  std::optional<Source> dam();
  /// A box or cylinder that stands on its end, up to five times as high as wide.
  std::optional<Source> column();
  /// Gives it a velocity along `direction` and a spin.
  void throw_body(Source& body, const Vec3d& direction, const Interval& speed);
  /// Puts the body in a part of the domain, clear of all that is there; false where it does not fit.
  bool add(Source body, const Part& part, Place where);
  /// Draws `n` bodies and adds them; what does not fit is left out, but for the first.
  bool add_bodies(int64_t n, Pose pose, const Part& part, Place where, const std::vector<MaterialModel>& models = {});

  Obstacle obstacle();
  /// Adds up to `n` drawn obstacles: half of them upright on the floor, the others turned at random anywhere.
  void add_obstacles(int64_t n);
  /// Adds an obstacle where it is.
  void add(const Obstacle& obstacle);
  /// Contact drawn for obstacles, for those that are made of several.
  void set_contact(Obstacle& obstacle);
  /// No obstacle may be added within this body.
  void keep_out(const Body& body) { kept_out_.push_back(body); }

  /// A stream of `width` and of a drawn speed along `direction`, as long as `most_particles` last. False where an
  /// obstacle or a body is in its way or it would be outside the walls.
  bool add_stream(const Vec3d& position, const Vec3d& direction, double width, const std::string& material,
                  double most_particles);

 private:
  void draw_walls();
  WallConfig wall(const RecipeSurface& surface);
  bool is_clear(const Body& envelope, double gap) const;
  double particle_volume() const;
  sparsegrid::LocalBox file_box(const Body& body) const;

  std::vector<Body> obstacle_envelopes_, body_envelopes_, kept_out_;
  std::vector<double> shares_;  ///< of particles, the next one last
};

}  // namespace graupel::mpm
