#include "graph/cuda/rollout/scene_motion.h"

#include <algorithm>
#include <cmath>

#include "core/parallel/cuda_check.h"
#include "core/parallel/parallel_for_in.h"
#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "graph/corrections/density_kernels.h"
#include "graph/features/rest_density.h"

namespace graupel::graph {

/// Positions of the last frames, one after the other; which one is the newest is known on the device alone.
struct FrameRing {
  Vec3f* frames;
  int64_t particles;
  int32_t count;
  const int32_t* newest;
  GRAUPEL_HD Vec3f& at(int back, int64_t i) const {  // back 0: the newest, -1: the one to come
    return frames[static_cast<int64_t>((*newest - back + count) % count) * particles + i];
  }
};

namespace {

/// Item i makes part i / particles of a row, so that neighbouring threads do the same.
struct WriteFeatures {
  FeatureRules rules;
  EnvironmentView environment;
  const int32_t* material;  ///< null: constants are not seen
  FrameRing ring;
  float* features;
  GRAUPEL_HD void operator()(int64_t item) const {
    const auto part = static_cast<FeaturePart>(item / ring.particles);
    const int64_t i = item % ring.particles;
    Vec3f position[most_history + 1];
    const int first = part == FeaturePart::motion ? 0 : rules.history;
    for (int t = first; t <= rules.history; ++t) position[t] = ring.at(rules.history - t, i);
    write_feature_part(part, rules, environment, AxisMap{}, material == nullptr ? no_material : material[i], position,
                       features + i * rules.width);
  }
};

/// v' = v + a, x' = x + v' in frame units (step_frame).
struct StepParticles {
  Normalization statistics;
  const float* output;  ///< of the frame, [particles, 3] in rows of `width`
  int32_t width;
  const Vec3f *before, *current;
  float limit;           ///< [m/frame]
  const int32_t* fault;  ///< the output is of no use
  FrameStatus* status;
  Vec3f* next;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault != 0) return;
    if (status->diverged != 0) {  // since a frame before
      next[i] = current[i];
      return;
    }
    const Vec3f velocity = current[i] - before[i] + real_acceleration(statistics, false, output + width * i);
    if (!(norm2(velocity) <= limit * limit)) status->diverged = 1;
    next[i] = current[i] + velocity;
  }
};

/// Moves `next`, reached from `from`, out of obstacles and into the walls.
template <bool AmongMoving>
struct PushParticles {
  SweptCollision way;
  CarrierView carriers;  ///< since the frame `from`
  bool project;
  FrameRing ring;
  const Vec3f* from;  ///< null: from where the frame to come has them already
  Vec3f* next;
  GRAUPEL_HD Vec3f pushed(int64_t i) const {
    Vec3f x = next[i];
    if (project) follow(from ? from[i] : ring.at(-1, i), x);
    return x;
  }
  GRAUPEL_HD void follow(const Vec3f& before, Vec3f& x) const {
    if constexpr (AmongMoving) {
      follow_among_moving(way, carriers.way, carriers.way == nullptr ? 0 : *carriers.count, before, x);
    } else {
      way.follow(before, x);
    }
  }
  GRAUPEL_HD void operator()(int64_t i) const { next[i] = ring.at(-1, i) = pushed(i); }
};

template <bool AmongMoving>
struct PushAndSpread {
  PushParticles<AmongMoving> push;
  density::Spread spread;
  GRAUPEL_HD void operator()(int64_t i) const {
    push(i);
    spread(i);
  }
};

/// The last of it: the frame to come becomes `current`, and `current` becomes `before`, unless the output is of no use
/// or the scene has diverged. The particle that is finished last makes the frame to come the newest.
template <bool AmongMoving>
struct PushLast {
  PushParticles<AmongMoving> push;
  const int32_t* fault;
  Vec3f *before, *current;
  FrameStatus* status;
  FrameStatus* seen;  ///< on the host
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault == 0 && status->diverged == 0) {
      const Vec3f x = push.pushed(i);
      before[i] = current[i];
      current[i] = push.ring.at(-1, i) = x;
    }
#ifdef __CUDA_ARCH__
    __threadfence();
#endif
    if (grid::add_to(status->finished, 1) == push.ring.particles - 1) finish();
  }
  GRAUPEL_HD void finish() const {
    status->finished = 0;
    status->fault = *fault;
    if (*fault == 0 && status->diverged == 0) status->newest = (status->newest + 1) % push.ring.count;
    *seen = *status;
  }
};

template <bool AmongMoving>
struct MoveAndPushLast {
  density::MoveParticle move;
  PushLast<AmongMoving> push;
  GRAUPEL_HD void operator()(int64_t i) const {
    move(i);
    push(i);
  }
};

}  // namespace

SceneMotion::SceneMotion(const FeatureConfig& config, const Normalization& normalization, double spacing)
    : config_(config), normalization_(normalization), spacing_(spacing) {
  GRAUPEL_CUDA_CHECK(cudaMallocHost(&seen_, sizeof(FrameStatus)));
}
SceneMotion::~SceneMotion() { cudaFreeHost(seen_); }

void SceneMotion::prepare(const CudaScene& scene, Vec3f* start) {
  scene_ = scene.scene;
  environment_ = scene.environment;
  particle_type_ = scene.particle_type;
  materials_ = scene.material;
  laws_ = scene.laws;
  poses_.start(*environment_, config_.bundle);  // no memory may be taken while a frame is recorded
  const std::size_t n = particle_type_->size(), known = static_cast<std::size_t>(start_frames());
  const std::vector<std::vector<Vec3f>>& positions = *scene.positions;
  particles_ = static_cast<int64_t>(n);
  GRAUPEL_ASSERT(known >= 2 && positions.size() >= known);
  GRAUPEL_ASSERT(!config_.material_constants || materials_->size() == n);
  for (std::size_t t = 0; t < known; ++t) {
    const std::vector<Vec3f>& frame = positions[positions.size() - known + t];
    GRAUPEL_ASSERT(frame.size() == n);
    std::copy(frame.begin(), frame.end(), start + t * n);
  }
  start_ = start;
  continues_ = scene.continues;
  if (continues_) return;
  largest_density_ =
      laws_.density_limit > 0
          ? laws_.density_limit * rest_density(*scene_, scene.matter ? *scene.matter : positions.back(), spacing_)
          : 0;
}

void SceneMotion::start(Vec3f* ring, int64_t frames, Vec3f* position, void* stream) {
  const auto in = static_cast<cudaStream_t>(stream);
  const auto n = static_cast<std::size_t>(particles_), known = static_cast<std::size_t>(start_frames());
  const std::size_t frame_bytes = n * sizeof(Vec3f);
  ring_ = ring;
  ring_frames_ = static_cast<int32_t>(start_frames() + frames);
  before_.resize_discard(n);
  next_.resize_discard(n);
  const auto copy = [&](void* to, const void* from, std::size_t bytes) {
    if (bytes > 0) GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDefault, in));
  };
  copy(ring, start_, known * frame_bytes);
  copy(before_.data(), ring + (known - 2) * n, frame_bytes);
  copy(position, ring + (known - 1) * n, frame_bytes);
  if (config_.material_constants) upload_in(stream, material_, *materials_);
  *seen_ = {static_cast<int32_t>(known) - 1, 0, 0, 0};
  copy(status_.data(), seen_, sizeof(FrameStatus));
  if (laws_.free_flight) {
    if (flight_)
      flight_->start(*scene_, *environment_, *particle_type_, stream);
    else
      flight_.emplace(Device::cuda, *scene_, *environment_, *particle_type_);
  }
  if (!(largest_density_ > 0)) return;
  if (!density_)
    density_.emplace(Device::cuda, *environment_, largest_density_, spacing_);
  else if (!continues_)
    density_->start(*environment_, largest_density_, spacing_, stream);
  density_->reserve(particles_);
}

Normalization SceneMotion::real_statistics() const {
  Normalization statistics = normalization_;
  if (laws_.network) return statistics;
  const double dt2 = scene_->frame_time * scene_->frame_time;
  for (int d = 0; d < 3; ++d) statistics.acceleration_mean[d] = static_cast<float>(scene_->gravity[d] * dt2);
  return statistics;
}

FrameRing SceneMotion::ring() { return {ring_, particles_, ring_frames_, &status_.data()->newest}; }

FreeFlight::Frame SceneMotion::flight_frame(const Rows& rows, int64_t frame) {
  flight_->place(poses_.obstacles(frame));
  return {&*flight_, before_.data(), rows.position, next_.data()};
}

void SceneMotion::launch_features(const std::vector<Placed>& scenes, void* stream) {
  std::vector<Loop<WriteFeatures>> loops;
  for (const auto& [m, rows] : scenes) {
    const FeatureRules rules(m->config_, m->normalization_);
    loops.push_back({feature_parts_of_row(rules) * m->particles_,
                     {rules, m->poses_.environment(0), m->config_.material_constants ? m->material_.data() : nullptr,
                      m->ring(), rows.features}});
  }
  parallel_loops_in(stream, Device::cuda, loops);
}

void SceneMotion::launch_groups(const std::vector<Placed>& scenes, void* stream) {
  std::vector<FreeFlight::Frame> frames;
  for (const auto& [m, rows] : scenes)
    if (m->finds_groups()) frames.push_back(m->flight_frame(rows, 0));
  FreeFlight::find_groups_of_all(frames, stream);
}

void SceneMotion::launch_move(const std::vector<Placed>& scenes, int64_t frame, void* stream) {
  bool some_move = false;
  for (const Placed& scene : scenes) some_move = some_move || scene.motion->poses_.any();
  if (some_move)
    launch_move_of<true>(scenes, frame, stream);
  else
    launch_move_of<false>(scenes, frame, stream);
}

template <bool AmongMoving>
void SceneMotion::launch_move_of(const std::vector<Placed>& scenes, int64_t frame, void* stream) {
  std::vector<Loop<StepParticles>> steps;
  std::vector<FreeFlight::Frame> flights;
  std::vector<Loop<PushAndSpread<AmongMoving>>> spreads;
  std::vector<DensityProjection::Frame> densities;
  std::vector<Loop<MoveAndPushLast<AmongMoving>>> last_of_dense;
  std::vector<Loop<PushLast<AmongMoving>>> last;
  for (const auto& [m, rows] : scenes) {
    const Vec3d& size = m->scene_->domain.size;
    const auto limit = static_cast<float>(std::max({size[0], size[1], size[2]}));
    Vec3f* const next = m->next_.data();
    steps.push_back({m->particles_,
                     {m->real_statistics(), rows.output + 3 * frame, static_cast<int32_t>(m->config_.output_width()),
                      m->before_.data(), rows.position, limit, rows.fault, m->status_.data(), next}});
    if (m->finds_groups()) flights.push_back(m->flight_frame(rows, frame));
    const PushParticles<AmongMoving> push{
        m->poses_.swept_collision(frame), m->poses_.carriers(frame), m->laws_.project, m->ring(), rows.position, next};
    PushLast<AmongMoving> end{push, rows.fault, m->before_.data(), rows.position, m->status_.data(), m->seen_};
    if (!(m->largest_density_ > 0) || frame + 1 < m->config_.bundle) {
      last.push_back({m->particles_, end});
      continue;
    }
    if (m->poses_.any()) m->density_->place(m->poses_.obstacles(frame), stream);
    m->density_->skip_where(rows.fault);
    spreads.push_back({m->particles_, {push, m->density_->spreading(next, m->particles_)}});
    densities.push_back({&*m->density_, next, m->particles_});
    end.push.from = nullptr;
    end.push.carriers = {};
    last_of_dense.push_back({m->particles_, {m->density_->moving(next), end}});
  }
  parallel_loops_in(stream, Device::cuda, steps);
  if (frame > 0) FreeFlight::find_groups_of_all(flights, stream);
  FreeFlight::correct_all(flights, stream);
  parallel_loops_in(stream, Device::cuda, spreads);
  DensityProjection::between(densities, stream);
  parallel_loops_in(stream, Device::cuda, last_of_dense);
  parallel_loops_in(stream, Device::cuda, last);
}

void SceneMotion::stop(const Vec3f& place, Vec3f* position) {
  const auto n = static_cast<std::size_t>(particles_);
  const std::vector<Vec3f> all(n, place);
  device_copy(Device::cuda, position, Device::cpu, all.data(), n * sizeof(Vec3f));
  *seen_ = {seen_->newest, 1, 0, 0};
  status_.upload({*seen_});
}

}  // namespace graupel::graph
