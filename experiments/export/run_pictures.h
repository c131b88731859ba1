// A picture of each frame of a run, as the report draws them: particles by material among the obstacles.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "compare/pictures/image.h"
#include "core/scene/scene.h"
#include "io/export/export.h"

namespace graupel::experiments {

class RunPictures {
 public:
  /// `spacing` is that of the particles [m], width and height those of the pictures [pixels].
  RunPictures(const Scene& scene, double spacing, int width, int height);
  ~RunPictures();

  /// Obstacles are where their scripts have them at the frame's time.
  compare::Image draw(int64_t frame, const io::PointFrame& points);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::experiments
