#include "graph/corrections/frame_corrections.h"

#include "graph/features/periodic_images.h"
#include "graph/features/rest_density.h"

namespace graupel::graph {

FrameCorrections::FrameCorrections(const Scene& scene, const Environment& environment, const std::vector<Vec3f>& matter,
                                   const CorrectionOptions& options)
    : scene_(scene), options_(options) {
  const double limit = options.density_limit * rest_density(scene, matter, options.spacing);
  if (limit > 0 && !environment.plane) density_.emplace(Device::cpu, environment, limit, options.spacing);
}

void FrameCorrections::apply(const Step& step, std::vector<Vec3f>& next) {
  if (options_.free_flight) hold_momentum(step, next);
  if (options_.project) project_out(step.environment, step.current, next, step.from);
  if (density_ && step.frame % options_.bundle == 0) {
    free_ = next;
    hold_density(step, next);
    if (options_.project) project_out(step.environment, free_, next);
  }
  keep_in_plane(step.environment, next);
}

void FrameCorrections::hold_momentum(const Step& step, std::vector<Vec3f>& next) {
  flight_is_stale_ = flight_is_stale_ || step.other_particles;
  if (!step.kinematic.empty()) return;
  if (!flight_)
    flight_.emplace(Device::cpu, scene_, step.environment, step.particle_type);
  else if (flight_is_stale_)
    flight_->set_particles(scene_, step.particle_type);
  flight_is_stale_ = false;
  flight_->place(step.environment.obstacles.view());
  flight_->find_groups(step.before.data(), step.current.data());
  flight_->correct(step.before.data(), step.current.data(), next.data());
}

/// Of what is not kinematic, with images beyond periodic walls.
void FrameCorrections::hold_density(const Step& step, std::vector<Vec3f>& next) {
  if (step.environment.moves()) density_->place(step.environment.obstacles.view());
  if (step.kinematic.empty() && !step.environment.is_periodic())
    return density_->apply(next.data(), static_cast<int64_t>(next.size()));
  std::vector<std::size_t> place;
  std::vector<Vec3f> matter;
  for (std::size_t i = 0; i < next.size(); ++i) {
    if (!step.kinematic.empty() && step.kinematic[i] != 0) continue;
    place.push_back(i);
    matter.push_back(next[i]);
  }
  const PeriodicImages images = periodic_images(step.environment, matter, image_cells * options_.spacing);
  for (std::size_t k = 0; k < images.source.size(); ++k)
    matter.push_back(matter[static_cast<std::size_t>(images.source[k])] + images.shift[k]);
  density_->apply(matter.data(), static_cast<int64_t>(matter.size()));
  for (std::size_t k = 0; k < place.size(); ++k) next[place[k]] = matter[k];
}

}  // namespace graupel::graph
