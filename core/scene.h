// The scene: domain, materials, particle sources, obstacles, time step and frames. SI units; y is up by convention.
// Read from JSON by io/scene_reader; docs/scene_format.md is made from the declarations here.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/fields.h"
#include "core/mat.h"
#include "core/material_config.h"
#include "core/mesh.h"
#include "core/vec.h"

namespace graupel {

/// What a wall or an obstacle does to the velocity of the material that touches it.
enum class Contact {
  stick,    ///< the material takes the obstacle's velocity
  slip,     ///< no normal velocity either way, Coulomb friction along the surface
  separate  ///< no velocity into the surface, free to leave, Coulomb friction along it
};
template <>
struct EnumWords<Contact> {
  static constexpr std::pair<const char*, Contact> words[] = {
      {"stick", Contact::stick}, {"slip", Contact::slip}, {"separate", Contact::separate}};
};

/// Bodies, each in its own frame: centred at the origin unless said otherwise, y up.
enum class Shape {
  box,          ///< edges `size`
  half_box,     ///< a box of edges `size` cut at mid height: the lower half, -size.y/2 <= y <= 0
  sphere,       ///< `radius`
  half_sphere,  ///< the part y >= 0 of a sphere of `radius`
  cone,         ///< base radius `radius` at y = -height/2, tip at y = +height/2
  pyramid,      ///< square base of edges size.x, size.z at y = -height/2, tip at y = +height/2
  cylinder,     ///< `radius`, axis y, |y| <= height/2
  plane,        ///< the half-space y <= 0
  mesh,         ///< closed triangles of `file` (.obj .ply .stl), coordinates times `scale`
  vdb,          ///< level set of `file` (.vdb), coordinates times `scale`
  points        ///< particles only: positions of `file` (.txt/.xyz: x y z a line; .ply), times `scale`
};
template <>
struct EnumWords<Shape> {
  static constexpr std::pair<const char*, Shape> words[] = {
      {"box", Shape::box},           {"half_box", Shape::half_box},
      {"sphere", Shape::sphere},     {"half_sphere", Shape::half_sphere},
      {"cone", Shape::cone},         {"pyramid", Shape::pyramid},
      {"cylinder", Shape::cylinder}, {"plane", Shape::plane},
      {"mesh", Shape::mesh},         {"vdb", Shape::vdb},
      {"points", Shape::points}};
};

/// A body with its pose: x_world = R(rotation_axis, rotation_angle) x_local + position.
struct Body {
  Shape shape = Shape::box;
  Vec3d size = {0.1, 0.1, 0.1};  ///< [m]
  double radius = 0.05;          ///< [m]
  double height = 0.1;           ///< [m]
  std::string file;              ///< absolute after reading
  double scale = 1;
  Vec3d position = {0, 0, 0};       ///< [m]
  Vec3d rotation_axis = {0, 1, 0};  ///< any length but zero
  double rotation_angle = 0;        ///< [degrees]

  std::shared_ptr<const TriangleMesh> mesh;          ///< filled by the reader for Shape::mesh, already scaled
  std::shared_ptr<const std::vector<Vec3d>> points;  ///< filled by the reader for Shape::points, already scaled

  /// R(rotation_axis, rotation_angle).
  Mat3d rotation() const {
    return rotation_about(normalized(rotation_axis), rotation_angle * 3.14159265358979323846 / 180);
  }
  Vec3d to_local(const Vec3d& world) const { return transpose(rotation()) * (world - position); }
  Vec3d to_world(const Vec3d& local) const { return rotation() * local + position; }

  template <typename Self, typename Visitor>
  static void body_fields(Visitor&& visit) {
    visit(&Self::shape, FieldInfo{.name = "shape", .unit = "", .meaning = "Kind of body", .required = true});
    visit(&Self::size, FieldInfo{.name = "size",
                                 .unit = "m",
                                 .meaning = "Edge lengths (pyramid: x and z of the base)",
                                 .range = Range::positive(),
                                 .required = true,
                                 .only_for = "box half_box pyramid"});
    visit(&Self::radius, FieldInfo{.name = "radius",
                                   .unit = "m",
                                   .meaning = "Radius (cone: of the base)",
                                   .range = Range::positive(),
                                   .required = true,
                                   .only_for = "sphere half_sphere cone cylinder"});
    visit(&Self::height, FieldInfo{.name = "height",
                                   .unit = "m",
                                   .meaning = "Height along the body's y axis",
                                   .range = Range::positive(),
                                   .required = true,
                                   .only_for = "cone pyramid cylinder"});
    visit(&Self::file, FieldInfo{.name = "file",
                                 .unit = "",
                                 .meaning = "File with the geometry, relative to the scene file",
                                 .required = true,
                                 .only_for = "mesh vdb points"});
    visit(&Self::scale, FieldInfo{.name = "scale",
                                  .unit = "",
                                  .meaning = "Factor on the file's coordinates",
                                  .range = Range::positive(),
                                  .only_for = "mesh vdb points"});
    visit(&Self::position,
          FieldInfo{.name = "position", .unit = "m", .meaning = "Where the body's own origin lies in the world"});
    visit(&Self::rotation_axis,
          FieldInfo{
              .name = "rotation_axis", .unit = "", .meaning = "Axis of the rotation, through the body's own origin"});
    visit(&Self::rotation_angle,
          FieldInfo{.name = "rotation_angle", .unit = "degrees", .meaning = "Angle of the rotation"});
  }
};

/// How particles are placed in a source.
enum class Sampling {
  random,           ///< Taichi Elements' rule: int(n V/dx^3 + 1) (box) or ceil(n V/dx^3) (others) uniform random points
  jittered_lattice  ///< a lattice of n points a cell, each moved at random inside its sub-cell
};
template <>
struct EnumWords<Sampling> {
  static constexpr std::pair<const char*, Sampling> words[] = {{"random", Sampling::random},
                                                               {"jittered_lattice", Sampling::jittered_lattice}};
};

/// A body of material at the start.
struct Source : Body {
  std::string material;  ///< key of `materials`
  Sampling sampling = Sampling::random;
  double particles_per_cell = 8;
  Vec3d velocity = {0, 0, 0};  ///< initial [m/s]

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = Source;
    Body::body_fields<S>(visit);
    visit(&S::material,
          FieldInfo{.name = "material", .unit = "", .meaning = "Key of the scene's materials", .required = true});
    visit(&S::sampling,
          FieldInfo{.name = "sampling", .unit = "", .meaning = "How particles are placed (not for points)"});
    visit(&S::particles_per_cell, FieldInfo{.name = "particles_per_cell",
                                            .unit = "",
                                            .meaning = "Particles in a grid cell",
                                            .range = {.low = 0, .high = 1000, .low_open = true}});
    visit(&S::velocity, FieldInfo{.name = "velocity", .unit = "m/s", .meaning = "Initial velocity"});
  }
};

/// A rigid, static obstacle.
struct Obstacle : Body {
  Contact contact = Contact::separate;
  double friction = 0;  ///< Coulomb coefficient

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using O = Obstacle;
    Body::body_fields<O>(visit);
    visit(&O::contact,
          FieldInfo{.name = "contact", .unit = "", .meaning = "What the surface does to material that touches it"});
    visit(&O::friction, FieldInfo{.name = "friction",
                                  .unit = "",
                                  .meaning = "Coulomb friction coefficient (slip and separate)",
                                  .range = Range::not_negative()});
  }
};

/// Axis-aligned domain with walls.
struct Domain {
  Vec3d origin = {0, 0, 0};  ///< lower corner [m]
  Vec3d size = {1, 1, 1};    ///< [m]
  double dx = 1.0 / 64;      ///< [m]
  Contact walls = Contact::separate;
  double wall_friction = 0;
  int64_t wall_cells = 3;  ///< cells between the domain's faces and the walls that hold the material

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using D = Domain;
    visit(&D::origin, FieldInfo{.name = "origin", .unit = "m", .meaning = "Lower corner of the domain"});
    visit(&D::size,
          FieldInfo{.name = "size", .unit = "m", .meaning = "Edge lengths of the domain", .range = Range::positive()});
    visit(&D::dx, FieldInfo{.name = "dx", .unit = "m", .meaning = "Grid spacing", .range = Range::positive()});
    visit(&D::walls, FieldInfo{.name = "walls", .unit = "", .meaning = "Contact at the walls"});
    visit(&D::wall_friction, FieldInfo{.name = "wall_friction",
                                       .unit = "",
                                       .meaning = "Coulomb friction coefficient of the walls",
                                       .range = Range::not_negative()});
    visit(&D::wall_cells,
          FieldInfo{.name = "wall_cells",
                    .unit = "cells",
                    .meaning = "Distance of the walls from the domain's faces; material stays inside them",
                    .range = Range::between(2, 16)});
  }
};

enum class StepPolicy {
  adaptive,  ///< the largest stable step: courant * dx / (speed + sound speed)
  fixed      ///< `substeps_per_frame` equal steps
};
template <>
struct EnumWords<StepPolicy> {
  static constexpr std::pair<const char*, StepPolicy> words[] = {{"adaptive", StepPolicy::adaptive},
                                                                 {"fixed", StepPolicy::fixed}};
};

struct TimeStep {
  StepPolicy policy = StepPolicy::adaptive;
  int64_t substeps_per_frame = 54;
  double courant = 0.5;
  double max_step = 1e-2;  ///< [s]

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = TimeStep;
    visit(&S::policy,
          FieldInfo{
              .name = "policy", .unit = "", .meaning = "adaptive: from stiffness and speed; fixed: equal substeps"});
    visit(&S::substeps_per_frame, FieldInfo{.name = "substeps_per_frame",
                                            .unit = "",
                                            .meaning = "Substeps of a frame",
                                            .range = Range::between(1, 1e6),
                                            .only_for = "fixed"});
    visit(&S::courant, FieldInfo{.name = "courant",
                                 .unit = "",
                                 .meaning = "Largest share of a cell that a wave or a particle crosses in a step",
                                 .range = {.low = 0, .high = 1, .low_open = true},
                                 .only_for = "adaptive"});
    visit(&S::max_step, FieldInfo{.name = "max_step",
                                  .unit = "s",
                                  .meaning = "Upper limit of the step",
                                  .range = Range::positive(),
                                  .only_for = "adaptive"});
  }
};

struct Scene {
  std::string name;
  std::string description;
  uint64_t seed = 0;  ///< of the particle sampling; --seed overrides it
  Domain domain;
  Vec3d gravity = {0, -9.8, 0};  ///< [m/s^2]
  std::map<std::string, MaterialConfig> materials;
  std::vector<Source> sources;
  std::vector<Obstacle> obstacles;
  std::optional<double> obstacle_voxel;  ///< [m]; default dx/2
  std::optional<double> obstacle_band;   ///< [m]; default max(4 dx, 0.1)
  bool push_out = true;                  ///< project particles out of obstacles after each substep
  TimeStep time_step;
  int64_t frames = 300;          ///< frames after the first; a trajectory has frames + 1
  double frame_time = 1.0 / 60;  ///< [s]

  std::string file;    ///< where it was read from; "" when made in memory
  std::string source;  ///< the JSON text, stored with every trajectory

  double voxel() const { return obstacle_voxel.value_or(domain.dx / 2); }
  double band() const { return obstacle_band.value_or(4 * domain.dx > 0.1 ? 4 * domain.dx : 0.1); }
  /// Lower and upper corner of the box that holds the material [m].
  Vec3d wall_low() const { return domain.origin + Vec3d::filled(static_cast<double>(domain.wall_cells) * domain.dx); }
  Vec3d wall_high() const {
    return domain.origin + domain.size - Vec3d::filled(static_cast<double>(domain.wall_cells) * domain.dx);
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using S = Scene;
    visit(&S::name, FieldInfo{.name = "name", .unit = "", .meaning = "Short name, used in file names and tables"});
    visit(&S::description, FieldInfo{.name = "description", .unit = "", .meaning = "What the scene shows"});
    visit(&S::domain, FieldInfo{.name = "domain", .unit = "", .meaning = "Domain, grid and walls"});
    visit(&S::gravity, FieldInfo{.name = "gravity", .unit = "m/s^2", .meaning = "Gravity"});
    visit(&S::materials, FieldInfo{.name = "materials", .unit = "", .meaning = "Materials by name", .required = true});
    visit(&S::sources,
          FieldInfo{.name = "sources", .unit = "", .meaning = "Bodies of material at the start", .required = true});
    visit(&S::obstacles, FieldInfo{.name = "obstacles", .unit = "", .meaning = "Rigid obstacles"});
    visit(&S::obstacle_voxel, FieldInfo{.name = "obstacle_voxel",
                                        .unit = "m",
                                        .meaning = "Voxel size of the obstacles' signed-distance grids; default dx/2",
                                        .range = Range::positive()});
    visit(&S::obstacle_band, FieldInfo{.name = "obstacle_band",
                                       .unit = "m",
                                       .meaning = "Half width of their narrow band; default max(4 dx, 0.1)",
                                       .range = Range::positive()});
    visit(&S::push_out,
          FieldInfo{.name = "push_out",
                    .unit = "",
                    .meaning = "Move particles that entered an obstacle back to its surface after each substep"});
    visit(&S::time_step, FieldInfo{.name = "time_step", .unit = "", .meaning = "Step size"});
    visit(&S::seed, FieldInfo{.name = "seed", .unit = "", .meaning = "Seed of the particle sampling"});
    visit(
        &S::frames,
        FieldInfo{.name = "frames", .unit = "", .meaning = "Frames after the first", .range = Range::between(0, 1e6)});
    visit(&S::frame_time,
          FieldInfo{.name = "frame_time", .unit = "s", .meaning = "Time between frames", .range = Range::positive()});
  }
};

}  // namespace graupel
