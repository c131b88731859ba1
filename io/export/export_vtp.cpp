// VTK PolyData, raw appended (https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html), and the .pvd
// that gives each file its time.
#include <numeric>

#include "core/system/atomic_file.h"
#include "io/config/config_document.h"
#include "io/export/export_frames.h"

namespace graupel::io {

namespace {

/// XML that refers to blocks of bytes at its end, each headed by its size.
class AppendedXml {
 public:
  template <typename T>
  void array(const std::string& type, const std::string& name, int components, const std::vector<T>& values) {
    xml_ += "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
            std::to_string(components) + "\" format=\"appended\" offset=\"" + std::to_string(blocks_.size()) + "\"/>\n";
    append_bytes(blocks_, static_cast<uint64_t>(values.size() * sizeof(T)));
    blocks_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  }
  void text(const std::string& xml) { xml_ += xml; }
  std::string finish() const {
    return xml_ + "<AppendedData encoding=\"raw\">\n_" + blocks_ + "\n</AppendedData>\n</VTKFile>\n";
  }

 private:
  std::string xml_, blocks_;
};

/// What a piece of PolyData has: its points, and cells of one kind.
enum class Cells { vertices, triangles };

/// The file up to its point data, of which `active` tells programs those with a meaning.
void begin_piece(AppendedXml& out, double time, std::size_t points, std::size_t cells, Cells kind,
                 const std::string& active) {
  out.text(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n");
  out.array("Float64", "TimeValue", 1, std::vector<double>{time});
  const std::string count = std::to_string(cells);
  out.text("</FieldData>\n<Piece NumberOfPoints=\"" + std::to_string(points) + "\" NumberOfVerts=\"" +
           (kind == Cells::vertices ? count : "0") + "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" +
           (kind == Cells::triangles ? count : "0") + "\">\n<PointData" + active + ">\n");
}

/// Points and cells of `corners` points each, behind the point data.
std::string finish_piece(AppendedXml& out, const std::vector<Vec3f>& position, const std::vector<int64_t>& connectivity,
                         int64_t corners, const std::string& element) {
  std::vector<int64_t> offsets(connectivity.size() / static_cast<std::size_t>(corners));
  for (std::size_t i = 0; i < offsets.size(); ++i) offsets[i] = corners * (static_cast<int64_t>(i) + 1);
  out.text("</PointData>\n<Points>\n");
  out.array("Float32", "Points", 3, position);
  out.text("</Points>\n<" + element + ">\n");
  out.array("Int64", "connectivity", 1, connectivity);
  out.array("Int64", "offsets", 1, offsets);
  out.text("</" + element + ">\n</Piece>\n</PolyData>\n");
  return out.finish();
}

std::string vtp_bytes(const PointFrame& points) {
  AppendedXml out;
  begin_piece(out, points.time, points.position.size(), points.position.size(), Cells::vertices,
              points.has_velocity() ? " Vectors=\"velocity\"" : "");
  out.array("Int32", "particle_type", 1, points.particle_type);
  if (!points.materials.empty()) out.array("Int32", "material", 1, points.materials.index);
  out.array("Int32", "id", 1, points.id);
  if (points.has_velocity()) out.array("Float32", "velocity", 3, points.velocity);
  if (points.has_volume_ratio()) out.array("Float32", "J", 1, points.volume_ratio);
  std::vector<int64_t> connectivity(points.position.size());  // a vertex cell a particle: visible without a filter
  std::iota(connectivity.begin(), connectivity.end(), int64_t(0));
  return finish_piece(out, points.position, connectivity, 1, "Verts");
}

std::string vtp_bytes(const SurfaceMesh& mesh, const MaterialSurface& of, double time) {
  AppendedXml out;
  begin_piece(out, time, mesh.position.size(), mesh.triangles.size(), Cells::triangles,
              mesh.velocity.empty() ? " Normals=\"Normals\"" : " Normals=\"Normals\" Vectors=\"velocity\"");
  out.array("Int32", "particle_type", 1, std::vector<int32_t>(mesh.position.size(), of.particle_type));
  if (of.index) out.array("Int32", "material", 1, std::vector<int32_t>(mesh.position.size(), *of.index));
  out.array("Float32", "Normals", 3, mesh.normal);
  if (!mesh.velocity.empty()) out.array("Float32", "velocity", 3, mesh.velocity);
  std::vector<int64_t> connectivity;
  for (const auto& triangle : mesh.triangles) connectivity.insert(connectivity.end(), triangle.begin(), triangle.end());
  return finish_piece(out, mesh.position, connectivity, 3, "Polys");
}

/// The .pvd of a sequence.
class TimeList {
 public:
  void add(double time, const std::string& part, const std::string& file) {
    lines_ += "<DataSet timestep=\"" + number_text(time) + "\"" + part + " file=\"" + file + "\"/>\n";
  }
  void write(const ExportTarget& target) const {
    write_file_atomically(target.folder + "/" + target.name + ".pvd",
                          "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n" +
                              lines_ + "</Collection>\n</VTKFile>\n");
  }

 private:
  std::string lines_;
};

class VtpPoints : public PointWriter {
 public:
  explicit VtpPoints(const ExportTarget& target) : target_(target) { prepare_export(target); }
  void write(int64_t frame, const PointFrame& points) override {
    const std::string file = frame_file(target_, frame, ".vtp");
    write_file_atomically(file, vtp_bytes(points));
    times_.add(points.time, "", file.substr(target_.folder.size() + 1));
  }
  void finish() override { times_.write(target_); }

 private:
  ExportTarget target_;
  TimeList times_;
};

/// A part of the .pvd is a material.
class VtpSurfaces : public MeshSequence {
 public:
  explicit VtpSurfaces(const ExportTarget& target) : MeshSequence(target, ".vtp") {}
  void finish() override { times_.write(target()); }

 private:
  std::string bytes_of(const SurfaceMesh& mesh, const MaterialSurface& of, double time) const override {
    return vtp_bytes(mesh, of, time);
  }
  void wrote(double time, const MaterialSurface& surface, const std::string& file) override {
    const int32_t part = surface.index ? *surface.index + 1 : surface.particle_type;
    times_.add(time, " part=\"" + std::to_string(part) + "\" name=\"" + surface.material + "\"", file);
  }

  TimeList times_;
};

}  // namespace

std::unique_ptr<PointWriter> make_vtp_points(const ExportTarget& target) { return std::make_unique<VtpPoints>(target); }
std::unique_ptr<SurfaceWriter> make_vtp_surfaces(const ExportTarget& target) {
  return std::make_unique<VtpSurfaces>(target);
}

}  // namespace graupel::io
