// Wavefront OBJ through tinyobjloader; materials are never opened.
#define TINYOBJLOADER_IMPLEMENTATION
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_formats.h"

namespace graupel::io {

namespace {

constexpr std::size_t most_corners = 5000;  ///< of a face: to cut it into triangles takes their square

/// A line of an OBJ file, split at blanks.
struct ObjLine {
  std::size_t number;
  std::string_view text, keyword;
  std::vector<std::string_view> values;
};

[[noreturn]] void fail(const std::string& name, const ObjLine& line, const std::string& problem) {
  std::string text(line.text.substr(0, 60));
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 32; }, ' ');
  mesh_fail(name, problem + " (line " + std::to_string(line.number) + ": '" + text + "')");
}

template <typename T>
bool is_whole(std::string_view word, T& value) {
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  return code == std::errc() && end == word.data() + word.size();
}

/// What may follow the coordinates: a weight or a colour, which are not read.
void check_vertex(const std::string& name, const ObjLine& line) {
  double value = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (axis >= line.values.size() || !is_whole(line.values[axis], value) || !std::isfinite(value))
      fail(name, line, "a vertex is not three finite numbers");
}

/// Whether a corner of a face reads v, v/vt, v//vn or v/vt/vn.
bool is_corner(std::string_view word) {
  int index = 0;
  for (int part = 0; part < 3; ++part) {
    const std::size_t end = std::min(word.find('/'), word.size());
    const bool may_lack = part == 1 && end < word.size();
    if (!(may_lack && end == 0) && !is_whole(word.substr(0, end), index)) return false;
    if (end == word.size()) return true;
    word.remove_prefix(end + 1);
  }
  return false;
}

void check_face(const std::string& name, const ObjLine& line) {
  if (line.values.size() < 3) fail(name, line, "a face has fewer than three corners");
  if (line.values.size() > most_corners)
    fail(name, line,
         "a face has " + std::to_string(line.values.size()) + " corners, at most " + std::to_string(most_corners) +
             " are cut into triangles");
  for (const std::string_view corner : line.values)
    if (!is_corner(corner)) fail(name, line, "a face's corner '" + std::string(corner.substr(0, 20)) + "' is no index");
}

/// The lines of vertices, texture coordinates, normals and faces; all others are empty, so that lines keep their
/// numbers. Among the others are skin weights, whose joints tinyobjloader turns into integers unseen. It also reads
/// damaged numbers as 0 or by their first digits, and leaves short faces out, so they are checked here.
std::string checked_geometry_lines(std::string_view bytes, const std::string& name) {
  if (bytes.find('\0') != std::string_view::npos) mesh_fail(name, "the file is no text (it holds a NUL byte)");
  std::string kept;
  ObjLine line{0, {}, {}, {}};
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t end = std::min(bytes.find_first_of("\r\n", at), bytes.size());
    const bool ends_crlf = at > 0 && bytes[at - 1] == '\r' && bytes[at] == '\n';
    if (!ends_crlf) ++line.number;
    line.text = bytes.substr(at, end - at);
    line.values.clear();
    for (std::size_t word = 0; (word = line.text.find_first_not_of(" \t", word)) < line.text.size();) {
      const std::size_t word_end = std::min(line.text.find_first_of(" \t", word), line.text.size());
      line.values.push_back(line.text.substr(word, word_end - word));
      word = word_end;
    }
    line.keyword = line.values.empty() ? std::string_view() : line.values.front();
    if (!line.values.empty()) line.values.erase(line.values.begin());
    if (line.keyword == "v") check_vertex(name, line);
    if (line.keyword == "f") check_face(name, line);
    if (line.keyword == "v" || line.keyword == "vt" || line.keyword == "vn" || line.keyword == "f")
      kept.append(line.text);
    if (end < bytes.size()) kept += bytes[end];
    at = end + 1;
  }
  return kept;
}

}  // namespace

TriangleMesh parse_obj(const std::string& bytes, const std::string& name) {
  tinyobj::attrib_t attributes;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  std::string warnings, errors;
  std::istringstream stream(checked_geometry_lines(mesh_text(bytes, name), name));
  const bool good = tinyobj::LoadObj(&attributes, &shapes, &materials, &warnings, &errors, &stream);
  if (!good || !errors.empty()) mesh_fail(name, "not a valid OBJ file (" + errors.substr(0, 200) + ")");
  if (warnings.find("Vertex indices out of bounds") != std::string::npos ||
      warnings.find("invalid vertex index") != std::string::npos)
    mesh_fail(name, "a face names a vertex that does not exist");

  TriangleMesh mesh;
  const auto& v = attributes.vertices;
  for (std::size_t i = 0; i + 2 < v.size(); i += 3) mesh.vertices.push_back({v[i], v[i + 1], v[i + 2]});
  for (const auto& shape : shapes) {
    const auto& indices = shape.mesh.indices;
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
      mesh.triangles.push_back({indices[i].vertex_index, indices[i + 1].vertex_index, indices[i + 2].vertex_index});
  }
  return mesh;
}

}  // namespace graupel::io
