// Stanford PLY, ASCII and binary little-endian: the vertices' x y z and the faces.
#include <array>
#include <charconv>
#include <cstring>
#include <limits>
#include <sstream>
#include <string_view>

#include "io/mesh/mesh_formats.h"

namespace graupel::io {

namespace {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct Property {
  std::string name;
  Scalar type = Scalar::float32;
  bool is_list = false;
  Scalar count_type = Scalar::uint8;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  std::vector<Element> elements;
  std::size_t size = 0;  ///< bytes
};

Scalar scalar_named(const std::string& word, const std::string& file) {
  static const std::vector<std::pair<std::string_view, Scalar>> names = {
      {"char", Scalar::int8},      {"int8", Scalar::int8},       {"uchar", Scalar::uint8},
      {"uint8", Scalar::uint8},    {"short", Scalar::int16},     {"int16", Scalar::int16},
      {"ushort", Scalar::uint16},  {"uint16", Scalar::uint16},   {"int", Scalar::int32},
      {"int32", Scalar::int32},    {"uint", Scalar::uint32},     {"uint32", Scalar::uint32},
      {"float", Scalar::float32},  {"float32", Scalar::float32}, {"double", Scalar::float64},
      {"float64", Scalar::float64}};
  for (const auto& [name, type] : names)
    if (name == word) return type;
  mesh_fail(file, "unknown PLY type '" + word.substr(0, 40) + "'");
}

std::size_t size_of(Scalar type) {
  constexpr std::array<std::size_t, 8> sizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

Property parse_property(std::istringstream& words, const std::string& file) {
  Property property;
  std::string type, count_type;
  words >> type;
  if (type == "list") {
    property.is_list = true;
    words >> count_type >> type;
    property.count_type = scalar_named(count_type, file);
  }
  property.type = scalar_named(type, file);
  words >> property.name;
  return property;
}

void parse_header_line(const std::string& line, Header& header, const std::string& file) {
  std::istringstream words(line);
  std::string word;
  words >> word;
  if (word == "format") {
    words >> word;
    if (word != "ascii" && word != "binary_little_endian")
      mesh_fail(file, "PLY format '" + word.substr(0, 40) + "' is not read (ascii and binary_little_endian are)");
    header.ascii = word == "ascii";
  } else if (word == "element") {
    Element element;
    if (!(words >> element.name >> element.count)) mesh_fail(file, "damaged PLY header");
    header.elements.push_back(element);
  } else if (word == "property") {
    if (header.elements.empty()) mesh_fail(file, "damaged PLY header (a property before any element)");
    header.elements.back().properties.push_back(parse_property(words, file));
  }
}

Header parse_header(std::string_view bytes, const std::string& file) {
  Header header;
  std::size_t at = 0;
  for (int line_number = 1;; ++line_number) {
    const auto end = bytes.find('\n', at);
    if (end == std::string_view::npos) mesh_fail(file, "damaged PLY header (it has no end_header)");
    std::string line(bytes.substr(at, end - at));
    if (!line.empty() && line.back() == '\r') line.pop_back();
    at = end + 1;
    if (line_number == 1 && line != "ply") mesh_fail(file, "not a PLY file");
    if (line == "end_header") break;
    parse_header_line(line, header, file);
  }
  header.size = at;
  return header;
}

/// Numbers of the body one after another, from text or bytes.
class Numbers {
 public:
  Numbers(std::string_view bytes, const Header& header, const std::string& file)
      : at_(bytes.data() + header.size), end_(bytes.data() + bytes.size()), ascii_(header.ascii), file_(file) {}

  double next(Scalar type) { return ascii_ ? next_text() : next_binary(type); }
  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }

 private:
  double next_text() {
    while (at_ != end_ && static_cast<unsigned char>(*at_) <= ' ') ++at_;
    double value = 0;
    const auto result = std::from_chars(at_, end_, value);
    if (result.ec != std::errc()) mesh_fail(file_, "the PLY file ends early or holds something that is no number");
    at_ = result.ptr;
    return value;
  }

  template <typename T>
  double take() {
    if (left() < sizeof(T)) mesh_fail(file_, "the PLY file ends early");
    T value;
    std::memcpy(&value, at_, sizeof(T));
    at_ += sizeof(T);
    return static_cast<double>(value);
  }

  double next_binary(Scalar type) {
    switch (type) {
      case Scalar::int8:
        return take<int8_t>();
      case Scalar::uint8:
        return take<uint8_t>();
      case Scalar::int16:
        return take<int16_t>();
      case Scalar::uint16:
        return take<uint16_t>();
      case Scalar::int32:
        return take<int32_t>();
      case Scalar::uint32:
        return take<uint32_t>();
      case Scalar::float32:
        return take<float>();
      case Scalar::float64:
        return take<double>();
    }
    return 0;
  }

  const char* at_;
  const char* end_;
  bool ascii_;
  const std::string& file_;
};

int32_t vertex_index(double value) {
  constexpr double most = std::numeric_limits<int32_t>::max();
  return value >= 0 && value <= most ? static_cast<int32_t>(value) : -1;  // -1 is refused by read_mesh
}

std::vector<double> read_list(Numbers& numbers, const Property& property, const std::string& file) {
  const double count = numbers.next(property.count_type);
  if (!(count >= 0) || count > static_cast<double>(numbers.left())) mesh_fail(file, "damaged PLY list");
  std::vector<double> values(static_cast<std::size_t>(count));
  for (double& value : values) value = numbers.next(property.type);
  return values;
}

void read_element(Numbers& numbers, const Element& element, TriangleMesh& mesh, const std::string& file) {
  const bool is_vertex = element.name == "vertex";
  Vec3d point = Vec3d::zero();
  for (const auto& property : element.properties) {
    if (property.is_list) {
      const auto values = read_list(numbers, property, file);
      const bool is_face = property.name == "vertex_indices" || property.name == "vertex_index";
      if (element.name != "face" || !is_face) continue;
      for (std::size_t i = 2; i < values.size(); ++i)
        mesh.triangles.push_back({vertex_index(values[0]), vertex_index(values[i - 1]), vertex_index(values[i])});
      continue;
    }
    const double value = numbers.next(property.type);
    for (int axis = 0; axis < 3; ++axis)
      if (is_vertex && property.name == std::string(1, "xyz"[axis])) point[axis] = value;
  }
  if (is_vertex) mesh.vertices.push_back(point);
}

void check_element(const Element& element, std::size_t bytes, bool ascii, const std::string& file) {
  std::size_t least = 0;  // bytes of one entry
  int coordinates = 0;
  for (const auto& property : element.properties) {
    least += ascii ? 2 : size_of(property.is_list ? property.count_type : property.type);
    coordinates += property.name == "x" || property.name == "y" || property.name == "z";
  }
  if (element.name == "vertex" && coordinates != 3) mesh_fail(file, "its vertices lack x, y or z");
  if (element.count > 0 && least == 0) mesh_fail(file, "PLY element '" + element.name + "' has no properties");
  const uint64_t most = least > 0 ? (bytes + 1) / least : 0;
  if (element.count > most)
    mesh_fail(file, "the PLY file ends early (element '" + element.name + "' has " + std::to_string(element.count) +
                        " entries, the file room for " + std::to_string(most) + ")");
}

}  // namespace

TriangleMesh parse_ply(const std::string& bytes, const std::string& name) {
  const std::string_view text = mesh_text(bytes, name);
  const Header header = parse_header(text, name);
  Numbers numbers(text, header, name);
  TriangleMesh mesh;
  for (const auto& element : header.elements) {
    check_element(element, numbers.left(), header.ascii, name);
    for (uint64_t i = 0; i < element.count; ++i) read_element(numbers, element, mesh, name);
  }
  return mesh;
}

}  // namespace graupel::io
