// Where the geometry files are that a scene names.
#pragma once

#include <string>
#include <utility>

namespace graupel::io {

class GeometryFinder {
 public:
  virtual ~GeometryFinder() = default;
  /// Absolute path for the scene's `given`; where nothing is there, the first place that was looked at.
  virtual std::string find(const std::string& given) const = 0;
  /// What helps when the file is nowhere.
  virtual std::string remedy(const std::string& given) const = 0;
};

/// A scene file: paths start from its folder.
class SceneFolder : public GeometryFinder {
 public:
  explicit SceneFolder(std::string folder) : folder_(std::move(folder)) {}
  std::string find(const std::string& given) const override;
  std::string remedy(const std::string& given) const override;

 private:
  std::string folder_;
};

/// A scene stored in a trajectory, which may have been moved since, with its geometry or without.
class AroundTrajectory : public GeometryFinder {
 public:
  explicit AroundTrajectory(std::string file) : file_(std::move(file)) {}
  std::string find(const std::string& given) const override;
  std::string remedy(const std::string& given) const override;

 private:
  std::string file_;
};

}  // namespace graupel::io
