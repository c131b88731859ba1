// Wavefront OBJ through tinyobjloader; materials are never opened.
#define TINYOBJLOADER_IMPLEMENTATION
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>

#include "io/mesh/mesh_formats.h"

namespace graupel::io {

namespace {

/// tinyobjloader reads a damaged number as 0, so the vertex lines are checked first.
void check_vertex_lines(const std::string& bytes, const std::string& name) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  std::size_t line = 1;
  for (std::size_t at = 0; at < bytes.size(); ++line) {
    const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
    if (end - at > 2 && bytes[at] == 'v' && is_space(bytes[at + 1])) {
      const char* word = bytes.data() + at + 1;
      for (int axis = 0; axis < 3; ++axis) {
        while (word != bytes.data() + end && is_space(*word)) ++word;
        double value = 0;
        const auto result = std::from_chars(word, bytes.data() + end, value);
        if (result.ec != std::errc() || !std::isfinite(value))
          mesh_fail(name, "the vertex in line " + std::to_string(line) + " is not three finite numbers");
        word = result.ptr;
      }
    }
    at = end + 1;
  }
}

/// The lines of vertices, texture coordinates, normals and faces; all others are empty, so that lines keep their
/// numbers. Among the others are skin weights, whose joints tinyobjloader turns into integers unseen.
std::string geometry_lines(const std::string& bytes) {
  std::string kept;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t end = std::min(bytes.find_first_of("\r\n", at), bytes.size());
    const std::size_t word = std::min(bytes.find_first_not_of(" \t", at), end);
    const std::size_t word_end = std::min(bytes.find_first_of(" \t", word), end);
    const std::string_view keyword(bytes.data() + word, word_end - word);
    if (keyword == "v" || keyword == "vt" || keyword == "vn" || keyword == "f") kept.append(bytes, at, end - at);
    if (end < bytes.size()) kept += bytes[end];
    at = end + 1;
  }
  return kept;
}

}  // namespace

TriangleMesh parse_obj(const std::string& bytes, const std::string& name) {
  check_vertex_lines(bytes, name);
  tinyobj::attrib_t attributes;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  std::string warnings, errors;
  std::istringstream stream(geometry_lines(bytes));
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
