// STL, ASCII and binary; its triangles repeat their corners, which become shared vertices here.
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <string_view>

#include "io/mesh/mesh_formats.h"

namespace graupel::io {

namespace {

constexpr std::size_t binary_header = 84;    // 80 bytes of text, then the number of triangles
constexpr std::size_t binary_triangle = 50;  // normal, three corners, two bytes of attributes

/// Gives equal positions one vertex.
class Welder {
 public:
  Welder(TriangleMesh& mesh, const std::string& name) : mesh_(mesh), name_(name) {}

  void corner(const Vec3d& position) {
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(position[axis])) mesh_fail(name_, "a vertex is not finite");
    // -0 and 0 are one place
    const std::array<double, 3> key = {position[0] + 0.0, position[1] + 0.0, position[2] + 0.0};
    const auto [found, is_new] = vertices_.try_emplace(key, static_cast<int32_t>(mesh_.vertices.size()));
    if (is_new) mesh_.vertices.push_back({key[0], key[1], key[2]});
    triangle_[corners_++ % 3] = found->second;
    if (corners_ % 3 == 0) mesh_.triangles.push_back(triangle_);
  }
  std::size_t corners() const { return corners_; }

 private:
  TriangleMesh& mesh_;
  const std::string& name_;
  std::map<std::array<double, 3>, int32_t> vertices_;
  std::array<int32_t, 3> triangle_ = {};
  std::size_t corners_ = 0;
};

uint32_t triangle_count(const std::string& bytes) {
  uint32_t count = 0;
  if (bytes.size() >= binary_header) std::memcpy(&count, bytes.data() + 80, sizeof count);
  return count;
}

/// Splits off the next word; empty at the end.
std::string_view next_word(std::string_view& text) {
  const auto is_space = [](char c) { return static_cast<unsigned char>(c) <= ' '; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  std::size_t length = 0;
  while (length < text.size() && !is_space(text[length])) ++length;
  const std::string_view word = text.substr(0, length);
  text.remove_prefix(length);
  return word;
}

double next_number(std::string_view& text, const std::string& name) {
  std::string_view word = next_word(text);
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0;
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  if (result.ec != std::errc() || result.ptr != word.data() + word.size())
    mesh_fail(name, "the STL file ends early or has a vertex that is not three numbers");
  return value;
}

void parse_ascii(std::string_view bytes, const std::string& name, Welder& weld) {
  std::string_view text = bytes, word;
  while (!(word = next_word(text)).empty()) {
    if (word != "vertex") continue;
    const double x = next_number(text, name), y = next_number(text, name), z = next_number(text, name);
    weld.corner({x, y, z});
  }
  if (weld.corners() % 3 != 0 || bytes.find("endsolid") == std::string_view::npos)
    mesh_fail(name, "the STL file ends early");
}

void parse_binary(const std::string& bytes, Welder& weld) {
  for (uint32_t t = 0; t < triangle_count(bytes); ++t) {
    std::array<float, 12> numbers;
    std::memcpy(numbers.data(), bytes.data() + binary_header + t * binary_triangle, sizeof numbers);
    for (int corner = 1; corner <= 3; ++corner)
      weld.corner({numbers[3 * corner], numbers[3 * corner + 1], numbers[3 * corner + 2]});
  }
}

}  // namespace

TriangleMesh parse_stl(const std::string& bytes, const std::string& name) {
  TriangleMesh mesh;
  Welder weld(mesh, name);
  // Binary files may start with "solid" too: the size decides.
  const uint64_t binary_size = binary_header + uint64_t(triangle_count(bytes)) * binary_triangle;
  if (bytes.size() >= binary_header && bytes.size() == binary_size) {
    parse_binary(bytes, weld);
  } else if (const std::string_view text = mesh_text(bytes, name); text.starts_with("solid")) {
    parse_ascii(text, name, weld);
  } else {
    mesh_fail(name, "neither an ASCII nor a complete binary STL file (" + std::to_string(bytes.size()) + " bytes)");
  }
  return mesh;
}

}  // namespace graupel::io
