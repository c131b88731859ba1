// Houdini's classic binary geometry, version 5 (.bgeo), as Partio reads and writes it: big-endian, points alone.
#include <bit>
#include <cstring>

#include "core/system/atomic_file.h"
#include "io/export/export_frames.h"

namespace graupel::io {

namespace {

/// Types of attributes.
enum class Bgeo : int32_t { real = 0, integer = 1, vector = 5 };

template <typename T>
void append_big_endian(std::string& out, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  for (std::size_t i = sizeof(T); i-- > 0;) out += bytes[i];
}
static_assert(std::endian::native == std::endian::little);

void append_big_endian(std::string& out, const Vec3f& v) {
  for (int axis = 0; axis < 3; ++axis) append_big_endian(out, v[axis]);
}

/// Name, number of components, type, default values.
void append_attribute(std::string& out, const std::string& name, uint16_t components, Bgeo type) {
  append_big_endian(out, static_cast<uint16_t>(name.size()));
  out += name;
  append_big_endian(out, components);
  append_big_endian(out, static_cast<int32_t>(type));
  for (uint16_t i = 0; i < components; ++i) append_big_endian(out, int32_t(0));
}

std::string bgeo_bytes(const PointFrame& points, const ExportTarget& target) {
  const bool velocity = points.has_velocity(), ratio = points.has_volume_ratio();
  const bool material = !points.materials.empty();
  const int32_t attributes = 3 + velocity + material + ratio;
  std::string out = "BgeoV";
  append_big_endian(out, int32_t(5));
  append_big_endian(out, static_cast<int32_t>(points.position.size()));
  for (const int32_t none : {0, 0, 0}) append_big_endian(out, none);  // primitives, groups of points and of primitives
  append_big_endian(out, attributes);
  for (const int32_t none : {0, 0, 0}) append_big_endian(out, none);  // attributes of vertices, primitives, the whole
  if (velocity) append_attribute(out, "v", 3, Bgeo::vector);
  append_attribute(out, "id", 1, Bgeo::integer);
  append_attribute(out, "type", 1, Bgeo::integer);
  if (material) append_attribute(out, "material", 1, Bgeo::integer);
  append_attribute(out, "pscale", 1, Bgeo::real);
  if (ratio) append_attribute(out, "J", 1, Bgeo::real);
  const auto usual_size = static_cast<float>(target.point_size);
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    append_big_endian(out, points.position[i]);
    append_big_endian(out, 1.0f);  // homogeneous coordinate
    if (velocity) append_big_endian(out, points.velocity[i]);
    append_big_endian(out, points.id[i]);
    append_big_endian(out, points.particle_type[i]);
    if (material) append_big_endian(out, points.materials.index[i]);
    append_big_endian(
        out, 0.5f * (target.sizes.empty() ? usual_size : target.sizes[static_cast<std::size_t>(points.id[i])]));
    if (ratio) append_big_endian(out, points.volume_ratio[i]);
  }
  out += std::string("\x00\xff", 2);  // end of the geometry
  return out;
}

class BgeoPoints : public PointWriter {
 public:
  explicit BgeoPoints(const ExportTarget& target) : target_(target) { prepare_export(target); }
  void write(int64_t frame, const PointFrame& points) override {
    write_file_atomically(frame_file(target_, frame, ".bgeo"), bgeo_bytes(points, target_));
  }

 private:
  ExportTarget target_;
};

}  // namespace

std::unique_ptr<PointWriter> make_bgeo_points(const ExportTarget& target) {
  return std::make_unique<BgeoPoints>(target);
}

}  // namespace graupel::io
