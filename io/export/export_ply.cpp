// Binary little-endian PLY: points a frame, or a mesh a frame and material.
#include "core/system/atomic_file.h"
#include "io/export/export_frames.h"

namespace graupel::io {

namespace {

/// "property float x" and so on, a line each.
std::string properties(const std::string& type, const std::vector<std::string>& names) {
  std::string lines;
  for (const std::string& name : names) lines.append("property ").append(type).append(" ").append(name).append("\n");
  return lines;
}

std::string vertex_header(std::size_t count) {
  return "ply\nformat binary_little_endian 1.0\ncomment metres, seconds; made by graupel\nelement vertex " +
         std::to_string(count) + "\n" + properties("float", {"x", "y", "z"});
}

std::string ply_bytes(const PointFrame& points) {
  const bool velocity = points.has_velocity(), ratio = points.has_volume_ratio();
  const bool material = !points.materials.empty();
  std::string out = vertex_header(points.position.size());
  if (velocity) out += properties("float", {"vx", "vy", "vz"});
  out += properties("int", {"type", "id"});
  if (material) out += properties("int", {"material"});
  if (ratio) out += properties("float", {"J"});
  out += "end_header\n";
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    append_bytes(out, points.position[i]);
    if (velocity) append_bytes(out, points.velocity[i]);
    append_bytes(out, points.particle_type[i]);
    append_bytes(out, points.id[i]);
    if (material) append_bytes(out, points.materials.index[i]);
    if (ratio) append_bytes(out, points.volume_ratio[i]);
  }
  return out;
}

class PlyPoints : public PointWriter {
 public:
  explicit PlyPoints(const ExportTarget& target) : target_(target) { prepare_export(target); }
  void write(int64_t frame, const PointFrame& points) override {
    write_file_atomically(frame_file(target_, frame, ".ply"), ply_bytes(points));
  }

 private:
  ExportTarget target_;
};

class PlySurfaces : public MeshSequence {
 public:
  explicit PlySurfaces(const ExportTarget& target) : MeshSequence(target, ".ply") {}

 private:
  std::string bytes_of(const SurfaceMesh& mesh, const MaterialSurface& of, double) const override {
    const bool velocity = !mesh.velocity.empty();
    std::string out = vertex_header(mesh.position.size()) + properties("float", {"nx", "ny", "nz"});
    if (velocity) out += properties("float", {"vx", "vy", "vz"});
    out += properties("int", {"type"}) + (of.index ? properties("int", {"material"}) : "") + "element face " +
           std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
    for (std::size_t i = 0; i < mesh.position.size(); ++i) {
      append_bytes(out, mesh.position[i]);
      append_bytes(out, mesh.normal[i]);
      if (velocity) append_bytes(out, mesh.velocity[i]);
      append_bytes(out, of.particle_type);
      if (of.index) append_bytes(out, *of.index);
    }
    for (const auto& triangle : mesh.triangles) {
      out += '\x03';
      append_bytes(out, triangle);
    }
    return out;
  }
};

}  // namespace

std::unique_ptr<PointWriter> make_ply_points(const ExportTarget& target) { return std::make_unique<PlyPoints>(target); }
std::unique_ptr<SurfaceWriter> make_ply_surfaces(const ExportTarget& target) {
  return std::make_unique<PlySurfaces>(target);
}

}  // namespace graupel::io
