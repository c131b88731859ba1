// Names and folders of exported frames, and which writer a format has.
#include "io/export/export_frames.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <utility>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/printable.h"

namespace graupel::io {

namespace {

template <typename Writer>
using Makers = std::vector<std::pair<std::string, std::unique_ptr<Writer> (*)(const ExportTarget&)>>;

const Makers<PointWriter>& point_makers() {
  static const Makers<PointWriter> makers = {{"vtp", make_vtp_points},
                                             {"ply", make_ply_points},
                                             {"vdb", make_vdb_points},
                                             {"bgeo", make_bgeo_points},
                                             {"usda", make_usda_points}};
  return makers;
}

const Makers<SurfaceWriter>& surface_makers() {
  static const Makers<SurfaceWriter> makers = {{"obj", make_obj_surfaces},
                                               {"ply", make_ply_surfaces},
                                               {"vtp", make_vtp_surfaces},
                                               {"vdb", make_vdb_surfaces},
                                               {"usda", make_usda_surfaces}};
  return makers;
}

template <typename Writer>
std::vector<std::string> names_of(const Makers<Writer>& makers) {
  std::vector<std::string> names;
  for (const auto& [name, make] : makers) names.push_back(name);
  return names;
}

template <typename Writer>
std::unique_ptr<Writer> make_writer(const Makers<Writer>& makers, const std::string& format, const ExportTarget& target,
                                    const char* what) {
  std::string allowed;
  for (const auto& [name, make] : makers) {
    if (name == format) return make(target);
    allowed += (allowed.empty() ? "" : ", ") + name;
  }
  throw ConfigError(std::string(what) + " are not written as '" + format + "' (allowed: " + allowed +
                    "). Choose one of these");
}

}  // namespace

const std::vector<std::string>& point_formats() {
  static const std::vector<std::string> names = names_of(point_makers());
  return names;
}
std::unique_ptr<PointWriter> make_point_writer(const std::string& format, const ExportTarget& target) {
  return make_writer(point_makers(), format, target, "particles");
}

const std::vector<std::string>& surface_formats() {
  static const std::vector<std::string> names = names_of(surface_makers());
  return names;
}
std::unique_ptr<SurfaceWriter> make_surface_writer(const std::string& format, const ExportTarget& target) {
  return make_writer(surface_makers(), format, target, "surfaces");
}

std::string as_file_name(std::string_view text) {
  constexpr std::string_view allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
  std::string name;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);  // 0: no character
    const std::string_view character = text.substr(0, std::max<std::size_t>(1, length));
    const bool fits =
        length > 1 ? printable(character) == character : allowed.find(character[0]) != std::string_view::npos;
    name += fits ? character : "_";
    text.remove_prefix(character.size());
  }
  return name;
}

void prepare_export(const ExportTarget& target) {
  const std::string& name = target.name;
  if (name.empty() || as_file_name(name) != name)
    throw ConfigError("'" + name + "' cannot name exported files (allowed: letters, digits, '.', '_', '-'). " +
                      "Choose another name");
  make_folder(target.folder);
}

std::string frame_file(const ExportTarget& target, int64_t frame, const std::string& ending) {
  char number[24];
  std::snprintf(number, sizeof number, "_%04lld", static_cast<long long>(frame));
  return target.folder + "/" + target.name + number + ending;
}

std::string frame_file(const ExportTarget& target, const std::string& material, int64_t frame,
                       const std::string& ending) {
  ExportTarget named = target;
  named.name += "_" + material;
  return frame_file(named, frame, ending);
}

void check_finite(int64_t frame, const PointFrame& points) {
  const auto check = [&](const std::vector<Vec3f>& vectors, float limit, const char* what) {
    for (std::size_t i = 0; i < vectors.size(); ++i)
      for (int d = 0; d < 3; ++d)
        if (!(std::abs(vectors[i][d]) <= limit))  // NaN too
          throw DivergedError("particle " + std::to_string(points.id[i]) + " of frame " + std::to_string(frame) +
                              " cannot be written (" + what +
                              (std::isfinite(vectors[i][d]) ? " is beyond 1e6 m" : " is not finite") +
                              "). Export the frames before it");
  };
  check(points.position, 1e6f, "position");
  check(points.velocity, std::numeric_limits<float>::max(), "velocity");
}

namespace {

/// Level sets are files of the surface itself.
class VdbSurfaces : public SurfaceWriter {
 public:
  explicit VdbSurfaces(const ExportTarget& target) : target_(target) { prepare_export(target); }
  void write(int64_t frame, double time, const std::vector<MaterialSurface>& surfaces) override {
    for (const MaterialSurface& one : surfaces)
      one.surface.write_vdb(frame_file(target_, one.material, frame, ".vdb"), time);
  }

 private:
  ExportTarget target_;
};

}  // namespace

std::unique_ptr<SurfaceWriter> make_vdb_surfaces(const ExportTarget& target) {
  return std::make_unique<VdbSurfaces>(target);
}

MeshSequence::MeshSequence(const ExportTarget& target, std::string ending)
    : target_(target), ending_(std::move(ending)) {
  prepare_export(target);
}

void MeshSequence::write(int64_t frame, double time, const std::vector<MaterialSurface>& surfaces) {
  for (const MaterialSurface& one : surfaces) {
    const std::string file = frame_file(target_, one.material, frame, ending_);
    write_file_atomically(file, bytes_of(one.surface.mesh(), one, time));
    wrote(time, one, std::filesystem::path(file).filename());
  }
}

}  // namespace graupel::io
