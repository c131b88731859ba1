// A text layer of Universal Scene Description (.usda) whose attributes have a sample a frame. Samples of one attribute
// lie together in the file, but come frame by frame: each attribute is kept in a file of its own until the end, so that
// memory holds one frame.
#pragma once

#include <cstdint>
#include <fstream>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "core/system/unfinished_file.h"
#include "io/export/export.h"

namespace graupel::io {

// Arrays as the format writes them: [1, 2], [(1, 2, 3), (4, 5, 6)].
std::string usda_array(const std::vector<int32_t>& values);
std::string usda_array(const std::vector<float>& values);
std::string usda_array(const std::vector<Vec3f>& values);
/// Lower and upper corner of all places, made larger by `margin` [m]; empty without any.
std::string usda_extent(const std::vector<Vec3f>& position, double margin);

class UsdaPrim {
 public:
  /// Adds a line that holds for all times.
  void constant(const std::string& line) { constants_ += "        " + line + "\n"; }
  /// The value of an attribute at a frame; `declaration` names its type too, as in "point3f[] points". Throws IoError.
  void sample(const std::string& declaration, int64_t frame, const std::string& value,
              const std::string& metadata = "");

 private:
  friend class UsdaLayer;
  struct Attribute {
    Attribute(std::string name, std::string about, const std::string& path);
    std::string declaration, metadata;
    UnfinishedFile file;  ///< its samples
    std::ofstream stream;
  };
  UsdaPrim(std::string type, std::string name, std::string files)
      : type_(std::move(type)), name_(std::move(name)), files_(std::move(files)) {}

  std::string type_, name_, files_, constants_;
  std::list<Attribute> attributes_;
};

class UsdaLayer {
 public:
  /// Makes the folder; the layer is <folder>/<name>.usda.
  explicit UsdaLayer(const ExportTarget& target);
  UsdaLayer(const UsdaLayer&) = delete;
  UsdaLayer& operator=(const UsdaLayer&) = delete;

  /// A child of the root, "Points" or "Mesh". It lives until finish().
  UsdaPrim& prim(const std::string& type, const std::string& name);
  /// The range of time codes grows by this frame.
  void cover(int64_t frame);
  /// Puts the layer together. Throws IoError.
  void finish();

 private:
  std::string header() const;

  ExportTarget target_;
  std::string path_;
  std::vector<std::unique_ptr<UsdaPrim>> prims_;
  int64_t first_ = 0, last_ = -1;
};

}  // namespace graupel::io
