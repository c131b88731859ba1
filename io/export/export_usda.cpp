// USD (.usda): all frames of the particles in a Points prim, or of each material's surface in a Mesh prim.
#include <map>
#include <optional>

#include "io/export/export_frames.h"
#include "io/export/number_list.h"
#include "io/export/usda_layer.h"

namespace graupel::io {

namespace {

const std::string a_value_a_point = "interpolation = \"vertex\"";

class UsdaPoints : public PointWriter {
 public:
  explicit UsdaPoints(const ExportTarget& target)
      : size_(target.point_size), sizes_(target.sizes), layer_(target), particles_(layer_.prim("Points", "particles")) {
    if (!sizes_.empty()) return;
    std::string width;
    append_number(width, static_cast<float>(size_));
    particles_.constant("float[] widths = [" + width + "] (\n            interpolation = \"constant\"\n        )");
  }

  void write(int64_t frame, const PointFrame& points) override {
    check_finite(frame, points);
    layer_.cover(frame);
    particles_.sample("float3[] extent", frame, usda_extent(points.position, 0.5 * size_));
    particles_.sample("int64[] ids", frame, usda_array(points.id));
    particles_.sample("point3f[] points", frame, usda_array(points.position));
    if (points.has_velocity()) particles_.sample("vector3f[] velocities", frame, usda_array(points.velocity));
    if (!sizes_.empty()) particles_.sample("float[] widths", frame, usda_array(sizes_of(points.id)), a_value_a_point);
    particles_.sample("int[] primvars:particle_type", frame, usda_array(points.particle_type), a_value_a_point);
    if (!points.materials.empty())
      particles_.sample("int[] primvars:material", frame, usda_array(points.materials.index), a_value_a_point);
    if (points.has_volume_ratio())
      particles_.sample("float[] primvars:J", frame, usda_array(points.volume_ratio), a_value_a_point);
  }
  void finish() override { layer_.finish(); }

 private:
  std::vector<float> sizes_of(const std::vector<int32_t>& id) const {
    std::vector<float> sizes;
    sizes.reserve(id.size());
    for (const int32_t i : id) sizes.push_back(sizes_[static_cast<std::size_t>(i)]);
    return sizes;
  }

  double size_;
  std::vector<float> sizes_;
  UsdaLayer layer_;
  UsdaPrim& particles_;
};

class UsdaSurfaces : public SurfaceWriter {
 public:
  explicit UsdaSurfaces(const ExportTarget& target) : layer_(target) {}

  void write(int64_t frame, double, const std::vector<MaterialSurface>& surfaces) override {
    layer_.cover(frame);
    std::map<std::string, UsdaPrim*> absent = materials_;
    for (const MaterialSurface& one : surfaces) {
      sample(material(one), frame, one.surface.mesh());
      absent.erase(one.material);
    }
    for (const auto& [name, prim] : absent) sample(*prim, frame, {});
    last_frame_ = frame;
  }
  void finish() override { layer_.finish(); }

 private:
  /// The mesh of a material, empty in the frames before its first.
  UsdaPrim& material(const MaterialSurface& surface) {
    UsdaPrim*& prim = materials_[surface.material];
    if (prim == nullptr) {
      prim = &layer_.prim("Mesh", surface.material);
      prim->constant("uniform token orientation = \"rightHanded\"");
      prim->constant("uniform token subdivisionScheme = \"none\"");
      prim->constant("int primvars:particle_type = " + std::to_string(surface.particle_type) +
                     " (\n            interpolation = \"constant\"\n        )");
      if (surface.index)
        prim->constant("int primvars:material = " + std::to_string(*surface.index) +
                       " (\n            interpolation = \"constant\"\n        )");
      if (last_frame_) sample(*prim, *last_frame_, {});
    }
    return *prim;
  }

  static void sample(UsdaPrim& prim, int64_t frame, const SurfaceMesh& mesh) {
    std::vector<int32_t> corners;
    for (const auto& triangle : mesh.triangles) corners.insert(corners.end(), triangle.begin(), triangle.end());
    prim.sample("float3[] extent", frame, usda_extent(mesh.position, 0));
    prim.sample("int[] faceVertexCounts", frame, usda_array(std::vector<int32_t>(mesh.triangles.size(), 3)));
    prim.sample("int[] faceVertexIndices", frame, usda_array(corners));
    prim.sample("normal3f[] normals", frame, usda_array(mesh.normal), a_value_a_point);
    prim.sample("point3f[] points", frame, usda_array(mesh.position));
    if (!mesh.velocity.empty() || mesh.position.empty())
      prim.sample("vector3f[] velocities", frame, usda_array(mesh.velocity));
  }

  UsdaLayer layer_;
  std::map<std::string, UsdaPrim*> materials_;
  std::optional<int64_t> last_frame_;
};

}  // namespace

std::unique_ptr<PointWriter> make_usda_points(const ExportTarget& target) {
  return std::make_unique<UsdaPoints>(target);
}
std::unique_ptr<SurfaceWriter> make_usda_surfaces(const ExportTarget& target) {
  return std::make_unique<UsdaSurfaces>(target);
}

}  // namespace graupel::io
