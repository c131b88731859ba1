// Wavefront OBJ: a mesh a frame and material. The format has no place for velocities.
#include "io/export/export_frames.h"
#include "io/export/number_list.h"

namespace graupel::io {

namespace {

void append_vectors(std::string& out, const char* keyword, const std::vector<Vec3f>& vectors) {
  for (const Vec3f& v : vectors) {
    out += keyword;
    for (int axis = 0; axis < 3; ++axis) {
      out += ' ';
      append_number(out, v[axis]);
    }
    out += '\n';
  }
}

class ObjSurfaces : public MeshSequence {
 public:
  explicit ObjSurfaces(const ExportTarget& target) : MeshSequence(target, ".obj") {}

 private:
  std::string bytes_of(const SurfaceMesh& mesh, const MaterialSurface&, double) const override {
    std::string out = "# metres; made by graupel\n";
    append_vectors(out, "v", mesh.position);
    append_vectors(out, "vn", mesh.normal);
    for (const auto& triangle : mesh.triangles) {
      out += 'f';
      for (const int32_t vertex : triangle) {
        out += ' ';
        append_number(out, vertex + 1);
        out += "//";
        append_number(out, vertex + 1);
      }
      out += '\n';
    }
    return out;
  }
};

}  // namespace

std::unique_ptr<SurfaceWriter> make_obj_surfaces(const ExportTarget& target) {
  return std::make_unique<ObjSurfaces>(target);
}

}  // namespace graupel::io
