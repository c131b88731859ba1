#include "experiments/export/run_pictures.h"

#include <optional>

#include "compare/pictures/backdrop.h"
#include "compare/pictures/bitmap_font.h"
#include "compare/pictures/raster.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::experiments {

struct RunPictures::Impl {
  Scene scene;
  double radius;
  int width, height;
  sparsegrid::ObstacleSet obstacles;
  std::optional<compare::Backdrop> backdrop = {};
};

RunPictures::RunPictures(const Scene& scene, double spacing, int width, int height)
    : impl_(std::make_unique<Impl>(Impl{scene, compare::sphere_radius(spacing * spacing * spacing), width, height,
                                        sparsegrid::ObstacleSet(scene)})) {}

RunPictures::~RunPictures() = default;

compare::Image RunPictures::draw(int64_t frame, const io::PointFrame& points) {
  if (!impl_->backdrop || impl_->scene.has_moving_obstacles())
    impl_->backdrop =
        compare::make_backdrop(impl_->scene, impl_->obstacles.at(points.time), impl_->width, impl_->height);
  compare::Image picture =
      compare::draw_particles(*impl_->backdrop, points.position, points.particle_type, impl_->radius);
  const std::string number = "frame " + std::to_string(frame);
  compare::draw_text(picture, impl_->width - compare::text_width(number) - 6, impl_->height - 13, number,
                     {235, 238, 242});
  return picture;
}

}  // namespace graupel::experiments
