// Reads meshes and point lists by file ending and checks them.
#include "io/mesh/mesh_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "core/system/atomic_file.h"
#include "core/system/byte_order_mark.h"
#include "core/system/error.h"
#include "io/mesh/mesh_formats.h"

namespace graupel::io {

namespace {

std::string ending_of(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return ending;
}

void scale_and_check(std::vector<Vec3d>& vertices, double scale, const std::string& path) {
  for (std::size_t i = 0; i < vertices.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      vertices[i][axis] *= scale;
      if (!std::isfinite(vertices[i][axis])) mesh_fail(path, "vertex " + std::to_string(i) + " is not finite");
    }
}

void check_indices(const TriangleMesh& mesh, const std::string& path) {
  if (mesh.triangles.empty()) mesh_fail(path, "there are no triangles in it");
  const auto count = static_cast<int64_t>(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const int32_t v : mesh.triangles[t])
      if (v < 0 || v >= count)
        mesh_fail(path, "triangle " + std::to_string(t) + " names vertex " + std::to_string(v) + " of " +
                            std::to_string(count));
}

/// Three numbers of a line; trailing text such as a colour is left alone.
bool parse_point(const char* at, const char* end, Vec3d& point) {
  for (int axis = 0; axis < 3; ++axis) {
    while (at != end && (*at == ' ' || *at == '\t' || *at == ',')) ++at;
    if (at != end && *at == '+') ++at;
    const auto result = std::from_chars(at, end, point[axis]);
    if (result.ec != std::errc()) return false;
    at = result.ptr;
    if (at != end && *at != ' ' && *at != '\t' && *at != ',' && *at != '\r' && *at != '#') return false;
  }
  return true;
}

std::vector<Vec3d> parse_points(const std::string& bytes, const std::string& path) {
  std::vector<Vec3d> points;
  const std::string_view text = mesh_text(bytes, path);
  const char* at = text.data();
  const char* end = at + text.size();
  for (int line = 1; at < end; ++line) {
    const char* line_end = std::find(at, end, '\n');
    const char* first = std::find_if(at, line_end, [](char c) { return c != ' ' && c != '\t' && c != '\r'; });
    if (first != line_end && *first != '#') {
      Vec3d point;
      if (!parse_point(first, line_end, point))
        mesh_fail(path + ":" + std::to_string(line), "not a point (write \"x y z\", numbers apart by spaces)");
      points.push_back(point);
    }
    at = line_end + 1;
  }
  return points;
}

}  // namespace

std::string_view mesh_text(const std::string& bytes, const std::string& name) {
  if (const std::string_view wide = wide_encoding(bytes); !wide.empty())
    mesh_fail(name, "the file is text in " + std::string(wide) +
                        " by its byte order mark (allowed: ASCII and UTF-8; an editor can save it so)");
  return std::string_view(bytes).substr(utf8_mark(bytes));
}

void mesh_fail(const std::string& name, const std::string& problem) {
  throw InputError("'" + name + "': " + problem + ". Export the geometry again or choose another file");
}

TriangleMesh read_mesh(const std::string& path, double scale) {
  const std::string ending = ending_of(path);
  TriangleMesh mesh;
  if (ending == ".obj") {
    mesh = parse_obj(read_file(path), path);
  } else if (ending == ".ply") {
    mesh = parse_ply(read_file(path), path);
  } else if (ending == ".stl") {
    mesh = parse_stl(read_file(path), path);
  } else {
    mesh_fail(path, "unknown kind of mesh (ending '" + ending + "', known: .obj .ply .stl)");
  }
  scale_and_check(mesh.vertices, scale, path);
  check_indices(mesh, path);
  return mesh;
}

std::vector<Vec3d> read_points(const std::string& path, double scale) {
  const std::string ending = ending_of(path);
  std::vector<Vec3d> points;
  if (ending == ".txt" || ending == ".xyz") {
    points = parse_points(read_file(path), path);
  } else if (ending == ".ply") {
    points = parse_ply(read_file(path), path).vertices;
  } else {
    mesh_fail(path, "unknown kind of point list (ending '" + ending + "', known: .txt .xyz .ply)");
  }
  scale_and_check(points, scale, path);
  if (points.empty()) mesh_fail(path, "there are no points in it");
  return points;
}

}  // namespace graupel::io
