// Writes particles and their surfaces in the formats other programs read, frame by frame.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"
#include "io/surface/particle_surface.h"

namespace graupel::io {

/// Where files go, and what formats tell of the whole run.
struct ExportTarget {
  std::string folder, name;       ///< files are <folder>/<name>_0007.vtp; see prepare_export
  double frame_time = 1.0 / 60;   ///< [s]
  double point_size = 0.01;       ///< largest diameter of the particles, as drawn [m]
  std::vector<float> sizes = {};  ///< [N] their diameters by PointFrame::id [m]; empty: all point_size
  char up_axis = 'Y';             ///< 'Y' or 'Z': the one against gravity
};

/// The particles of a frame that are in the run.
struct PointFrame {
  double time = 0;                     ///< [s]
  std::vector<Vec3f> position;         ///< [n, 3] [m]
  std::vector<Vec3f> velocity;         ///< [n, 3] [m/s]; empty where it was not stored
  std::vector<int32_t> particle_type;  ///< [n]
  std::vector<int32_t> id;             ///< [n] place in the trajectory
  std::vector<float> volume_ratio;     ///< [n] J; empty where the fields that tell it were not stored
  ParticleMaterials materials = {};    ///< [n]; empty where they were not stored
  bool stores_velocity = false, stores_volume_ratio = false;  ///< in all frames, also in those without particles

  bool has_velocity() const { return stores_velocity || !velocity.empty(); }
  bool has_volume_ratio() const { return stores_volume_ratio || !volume_ratio.empty(); }
};
/// Of frame `frame` of a trajectory with these types and materials. J is what the field `plastic` holds for water,
/// jelly, neo_hookean and toothpaste, and det F by `deformation_gradient` for the others; 1 for those without stress.
PointFrame points_of(const std::vector<int32_t>& particle_type, const ParticleFrame& frame,
                     const ParticleMaterials& materials = {});
/// The fields that J is read from.
inline constexpr std::array volume_ratio_fields = {ParticleField::plastic, ParticleField::deformation_gradient};

/// The particles of one material, under its surface.
struct MaterialSurface {
  std::string material;          ///< the scene's name of it where that was stored, else that of the particles' type
  int32_t particle_type = 0;     ///< of its first particle
  std::optional<int32_t> index;  ///< in ParticleMaterials, where it was stored
  ParticleSurface surface;
};
/// What has a surface of its own.
struct SurfaceBody {
  int32_t particle_type = 0;
  std::optional<int32_t> index;  ///< in ParticleMaterials, where it was stored
  SurfaceSettings settings;
};
/// All of a trajectory, by ascending type and index.
std::vector<SurfaceBody> surface_bodies(const std::vector<int32_t>& particle_type, const ParticleMaterials& materials,
                                        const SurfaceSettings& settings);
/// One of each body, without triangles where no particle of it is in the run. Names are of letters, digits and '_', and
/// differ; in messages they follow `where`.
std::vector<MaterialSurface> surfaces_of(const PointFrame& points, const std::vector<SurfaceBody>& bodies,
                                         const std::string& where);

/// A sequence of frames in one format. Files appear when they are whole; without finish() a sequence lacks the file
/// that binds it (.pvd), or is not there (.usda).
class PointWriter {
 public:
  virtual ~PointWriter() = default;
  /// Ascending frame numbers. Throws IoError, and DivergedError where a format cannot hold positions that are not
  /// finite.
  virtual void write(int64_t frame, const PointFrame& points) = 0;
  virtual void finish() {}
};
/// vtp (ParaView), ply, vdb (points), bgeo (Houdini), usda.
const std::vector<std::string>& point_formats();
/// Makes the folder. Throws ConfigError for another format, or a name that as_file_name() changes.
std::unique_ptr<PointWriter> make_point_writer(const std::string& format, const ExportTarget& target);

/// The same for surfaces, one file a frame and material.
class SurfaceWriter {
 public:
  virtual ~SurfaceWriter() = default;
  virtual void write(int64_t frame, double time, const std::vector<MaterialSurface>& surfaces) = 0;
  virtual void finish() {}
};
/// obj, ply, vtp, vdb (level set and velocities), usda.
const std::vector<std::string>& surface_formats();
std::unique_ptr<SurfaceWriter> make_surface_writer(const std::string& format, const ExportTarget& target);

}  // namespace graupel::io
