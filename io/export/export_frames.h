// What the exporters share: checked names, numbered frame files, little-endian bytes.
#pragma once

#include <string>
#include <string_view>

#include "io/export/export.h"

namespace graupel::io {

/// `text` with '_' for each character that names of exported files do not have. They have letters, digits, '.', '_',
/// '-' and what is beyond ASCII (UTF-8, no control characters): no format's reader takes these for anything else.
std::string as_file_name(std::string_view text);
/// Makes the folder. Throws ConfigError for a name with other characters.
void prepare_export(const ExportTarget& target);
/// "<folder>/<name>_0007<ending>", with more digits where there are more frames; `material` follows the name.
std::string frame_file(const ExportTarget& target, int64_t frame, const std::string& ending);
std::string frame_file(const ExportTarget& target, const std::string& material, int64_t frame,
                       const std::string& ending);
/// Throws DivergedError naming frame and particle where a position or velocity is not finite.
void check_finite(int64_t frame, const PointFrame& points);
/// Appends the bytes of a number as they lie in memory (little-endian on every machine this runs on).
template <typename T>
void append_bytes(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Writes each material's mesh to a file of its own, as its derived class makes the bytes.
class MeshSequence : public SurfaceWriter {
 public:
  MeshSequence(const ExportTarget& target, std::string ending);
  void write(int64_t frame, double time, const std::vector<MaterialSurface>& surfaces) override;

 protected:
  const ExportTarget& target() const { return target_; }

 private:
  virtual std::string bytes_of(const SurfaceMesh& mesh, const MaterialSurface& of, double time) const = 0;
  /// After a file was written; `file` is its name in the folder.
  virtual void wrote(double, const MaterialSurface&, const std::string&) {}

  ExportTarget target_;
  std::string ending_;
};

// One file a format makes these.
std::unique_ptr<PointWriter> make_vtp_points(const ExportTarget& target);
std::unique_ptr<PointWriter> make_ply_points(const ExportTarget& target);
std::unique_ptr<PointWriter> make_vdb_points(const ExportTarget& target);
std::unique_ptr<PointWriter> make_bgeo_points(const ExportTarget& target);
std::unique_ptr<PointWriter> make_usda_points(const ExportTarget& target);
std::unique_ptr<SurfaceWriter> make_obj_surfaces(const ExportTarget& target);
std::unique_ptr<SurfaceWriter> make_ply_surfaces(const ExportTarget& target);
std::unique_ptr<SurfaceWriter> make_vtp_surfaces(const ExportTarget& target);
std::unique_ptr<SurfaceWriter> make_vdb_surfaces(const ExportTarget& target);
std::unique_ptr<SurfaceWriter> make_usda_surfaces(const ExportTarget& target);

}  // namespace graupel::io
