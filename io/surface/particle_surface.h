// The surface of a body of particles, as a level set and as a triangle mesh: OpenVDB makes it, behind this header.
//
// A level set of the union of spheres about the particles (Museth 2013) closes gaps that are narrower than two radii.
// Mean curvature flow smooths it. It then moves inwards, to half a spacing from the outermost particles: there a body
// that is full of particles ends. Particles that lie outside by then, those of spray, become spheres of their volume.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/math/vec.h"

namespace graupel::io {

struct SurfaceSettings {
  double spacing = 0;  ///< of neighbouring particles where the material is full of them [m]
  double radius = 0;   ///< of the spheres [m], from spacing/2 to 8 spacing
  double voxel = 0;    ///< edge of the level set's voxels [m], from radius/16 to radius/1.5
  int smoothing = 3;   ///< passes of mean curvature flow, 0 to 100
};

/// What goes well with a spacing: spheres of 1.5 spacings, voxels of half of one.
SurfaceSettings default_surface_settings(double spacing);
/// Throws ConfigError that names the option (--radius, --voxel, --smoothing), its value and the allowed range.
void check_surface_settings(const SurfaceSettings& settings);

/// Bytes that the surface of these particles may take at most while it is made.
double surface_bytes(const std::vector<Vec3f>& position, const SurfaceSettings& settings);

/// Closed triangle mesh.
struct SurfaceMesh {
  std::vector<Vec3f> position;                    ///< [n, 3] [m]
  std::vector<Vec3f> normal;                      ///< [n, 3] outwards, unit
  std::vector<Vec3f> velocity;                    ///< [n, 3] [m/s]; empty where the particles have none
  std::vector<std::array<int32_t, 3>> triangles;  ///< counter-clockwise seen from outside
};

class ParticleSurface {
 public:
  /// `velocity` is [n, 3] as `position`, or empty. `where` names the particles in messages. Throws ConfigError when the
  /// level set would not fit into the memory that is left, before it is made; DivergedError for a position that is not
  /// finite or beyond 2^24 voxels of the origin.
  ParticleSurface(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                  const SurfaceSettings& settings, const std::string& where);
  ~ParticleSurface();
  ParticleSurface(ParticleSurface&&) noexcept;

  SurfaceMesh mesh() const;
  /// Level set `surface` and, where there are velocities, vectors `v` [m/s] in its narrow band. Throws IoError.
  void write_vdb(const std::string& path, double time) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::io
