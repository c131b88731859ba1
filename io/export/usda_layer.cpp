#include "io/export/usda_layer.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/config/config_document.h"
#include "io/export/export_frames.h"
#include "io/export/number_list.h"

namespace graupel::io {

namespace {

[[noreturn]] void fail_to_write(const std::string& path) {
  throw IoError("cannot write '" + path + "' (" + std::strerror(errno) +
                "). Free space there or choose another folder");
}

/// `out << file.rdbuf()` would not tell of a write that fails after the first one.
void append_file(const std::string& path, std::ofstream& out) {
  std::ifstream in(path, std::ios::binary);
  std::vector<char> block(std::size_t(1) << 16);
  while (in.read(block.data(), static_cast<std::streamsize>(block.size())) || in.gcount() > 0)
    out.write(block.data(), in.gcount());
  if (!in.eof()) throw IoError("cannot read '" + path + "' again (" + std::strerror(errno) + "). Run the export again");
}

/// A stream that is ready; its failures are IoErrors of `path`.
std::ofstream open_to_write(const std::string& path) {
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  if (!stream) fail_to_write(path);
  return stream;
}

void append_element(std::string& out, int32_t value) { append_number(out, value); }
void append_element(std::string& out, float value) { append_number(out, value); }
void append_element(std::string& out, const Vec3f& v) {
  out += '(';
  for (int axis = 0; axis < 3; ++axis) {
    if (axis > 0) out += ", ";
    append_number(out, v[axis]);
  }
  out += ')';
}

template <typename T>
std::string array_text(const std::vector<T>& values) {
  std::string out = "[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) out += ", ";
    append_element(out, values[i]);
  }
  return out + "]";
}

/// A name that every version of USD allows: letters of ASCII, digits and '_', not a digit first.
std::string identifier(const std::string& name) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::string out = name;
  for (char& c : out)
    if (!is_digit(c) && !(c >= 'a' && c <= 'z') && !(c >= 'A' && c <= 'Z')) c = '_';
  return is_digit(out.front()) ? "_" + out : out;
}

}  // namespace

std::string usda_array(const std::vector<int32_t>& values) { return array_text(values); }
std::string usda_array(const std::vector<float>& values) { return array_text(values); }
std::string usda_array(const std::vector<Vec3f>& values) { return array_text(values); }

std::string usda_extent(const std::vector<Vec3f>& position, double margin) {
  if (position.empty()) return "[(0, 0, 0), (0, 0, 0)]";
  Vec3f low = position.front(), high = low;
  for (const Vec3f& x : position)
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], x[axis]);
      high[axis] = std::max(high[axis], x[axis]);
    }
  const Vec3f around = Vec3f::filled(static_cast<float>(margin));
  return array_text(std::vector<Vec3f>{low - around, high + around});
}

UsdaPrim::Attribute::Attribute(std::string name, std::string about, const std::string& path)
    : declaration(std::move(name)), metadata(std::move(about)), file(path), stream(open_to_write(path)) {}

void UsdaPrim::sample(const std::string& declaration, int64_t frame, const std::string& value,
                      const std::string& metadata) {
  auto attribute = std::find_if(attributes_.begin(), attributes_.end(),
                                [&](const Attribute& one) { return one.declaration == declaration; });
  if (attribute == attributes_.end()) {
    attributes_.emplace_back(declaration, metadata, files_ + std::to_string(attributes_.size()) + ".part");
    attribute = std::prev(attributes_.end());
  }
  attribute->stream << "            " << frame << ": " << value << ",\n";
  if (!attribute->stream.flush()) fail_to_write(attribute->file.path());
}

UsdaLayer::UsdaLayer(const ExportTarget& target) : target_(target), path_(target.folder + "/" + target.name + ".usda") {
  prepare_export(target);
}

UsdaPrim& UsdaLayer::prim(const std::string& type, const std::string& name) {
  const std::string files = path_ + "." + std::to_string(prims_.size()) + ".";
  prims_.push_back(std::unique_ptr<UsdaPrim>(new UsdaPrim(type, identifier(name), files)));
  return *prims_.back();
}

void UsdaLayer::cover(int64_t frame) {
  first_ = last_ < 0 ? frame : std::min(first_, frame);
  last_ = std::max(last_, frame);
}

std::string UsdaLayer::header() const {
  const std::string rate = number_text(1 / target_.frame_time);
  return "#usda 1.0\n(\n    defaultPrim = \"" + identifier(target_.name) +
         "\"\n    doc = \"Made by graupel. Time codes are frames of the run, units metres and seconds.\"\n" +
         "    endTimeCode = " + std::to_string(last_) + "\n    framesPerSecond = " + rate +
         "\n    metersPerUnit = 1\n    startTimeCode = " + std::to_string(first_) +
         "\n    timeCodesPerSecond = " + rate + "\n    upAxis = \"" + target_.up_axis + "\"\n)\n\ndef Xform \"" +
         identifier(target_.name) + "\"\n{\n";
}

void UsdaLayer::finish() {
  UnfinishedFile part(path_ + ".part");
  std::ofstream out = open_to_write(part.path());
  out << header();
  for (const auto& prim : prims_) {
    out << "    def " << prim->type_ << " \"" << prim->name_ << "\"\n    {\n" << prim->constants_;
    for (UsdaPrim::Attribute& attribute : prim->attributes_) {
      attribute.stream.close();
      if (!attribute.metadata.empty())
        out << "        " << attribute.declaration << " (\n            " << attribute.metadata << "\n        )\n";
      out << "        " << attribute.declaration << ".timeSamples = {\n";
      append_file(attribute.file.path(), out);
      out << "        }\n";
    }
    out << "    }\n";
  }
  out << "}\n";
  out.close();
  if (!out) fail_to_write(path_);
  finish_part_file(path_);
  part.keep();
  prims_.clear();  // with the files of their samples
}

}  // namespace graupel::io
