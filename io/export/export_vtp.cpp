// VTK PolyData, raw appended (https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html), and the .pvd
// that gives each file its time.
#include "core/system/atomic_file.h"
#include "io/config/config_document.h"
#include "io/export/export.h"
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

std::string vtp_bytes(const ActiveFrame& active) {
  const ParticleFrame& frame = active.frame;
  const std::size_t count = frame.position.size();
  std::vector<int64_t> connectivity(count), offsets(count);  // one vertex cell a particle: visible without a filter
  for (std::size_t i = 0; i < count; ++i) {
    connectivity[i] = static_cast<int64_t>(i);
    offsets[i] = static_cast<int64_t>(i) + 1;
  }
  AppendedXml out;
  out.text(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n");
  out.array("Float64", "TimeValue", 1, std::vector<double>{frame.time});
  out.text("</FieldData>\n<Piece NumberOfPoints=\"" + std::to_string(count) + "\" NumberOfVerts=\"" +
           std::to_string(count) + "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData>\n");
  out.array("Int32", "particle_type", 1, active.particle_type);
  if (!frame.velocity.empty()) out.array("Float32", "velocity", 3, frame.velocity);
  out.text("</PointData>\n<Points>\n");
  out.array("Float32", "Points", 3, frame.position);
  out.text("</Points>\n<Verts>\n");
  out.array("Int64", "connectivity", 1, connectivity);
  out.array("Int64", "offsets", 1, offsets);
  out.text("</Verts>\n</Piece>\n</PolyData>\n");
  return out.finish();
}

}  // namespace

void export_vtp(const Trajectory& trajectory, const std::string& folder, const std::string& name) {
  prepare_export(trajectory, folder, name);
  std::string times = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
  for (std::size_t k = 0; k < trajectory.frames.size(); ++k) {
    const std::string file = frame_file_name(name, k, ".vtp");
    write_file_atomically(folder + "/" + file, vtp_bytes(active_particles(trajectory, trajectory.frames[k])));
    times += "<DataSet timestep=\"" + number_text(trajectory.frames[k].time) + "\" file=\"" + file + "\"/>\n";
  }
  write_file_atomically(folder + "/" + name + ".pvd", times + "</Collection>\n</VTKFile>\n");
}

}  // namespace graupel::io
