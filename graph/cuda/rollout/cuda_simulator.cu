#include "graph/cuda_simulator.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/parallel/cuda_check.h"
#include "core/parallel/parallel_for_in.h"
#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "graph/corrections/density_kernels.h"
#include "graph/corrections/density_projection.h"
#include "graph/corrections/free_flight.h"
#include "graph/cuda/rollout/frame_model.h"
#include "graph/features/normalization.h"
#include "graph/features/rest_density.h"

namespace graupel::graph {

namespace {

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

/// What a frame leaves for the host.
struct FrameStatus {
  int32_t newest, diverged, fault;
  int32_t finished;  ///< particles of the frame that is being made
};

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
    const Vec3f velocity = current[i] - before[i] + real_acceleration(statistics, false, output + width * i);
    if (!(norm2(velocity) <= limit * limit)) status->diverged = 1;
    next[i] = current[i] + velocity;
  }
};

/// Moves `next`, reached from `from`, out of obstacles and into the walls.
struct PushParticles {
  SweptCollision way;
  bool project;
  FrameRing ring;
  const Vec3f* from;  ///< null: from where the frame to come has them already
  Vec3f* next;
  GRAUPEL_HD Vec3f pushed(int64_t i) const {
    Vec3f x = next[i];
    if (project) way.follow(from ? from[i] : ring.at(-1, i), x);
    return x;
  }
  GRAUPEL_HD void operator()(int64_t i) const { next[i] = ring.at(-1, i) = pushed(i); }
};

struct PushAndSpread {
  PushParticles push;
  density::Spread spread;
  GRAUPEL_HD void operator()(int64_t i) const {
    push(i);
    spread(i);
  }
};

/// The last of it: the frame to come becomes `current`, and `current` becomes `before`, unless the output is of no use.
/// The particle that is finished last makes the frame to come the newest.
struct PushLast {
  PushParticles push;
  const int32_t* fault;
  Vec3f *before, *current;
  FrameStatus* status;
  FrameStatus* seen;  ///< on the host
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault == 0) {
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

struct MoveAndPushLast {
  density::MoveParticle move;
  PushLast push;
  GRAUPEL_HD void operator()(int64_t i) const {
    move(i);
    push(i);
  }
};

enum Mark { begin, features_done, hierarchy_done, network_done, end, marks };

}  // namespace

/// A bundle of frames is launched once, into a graph, with room for a larger network's graph than there is; one that
/// needs more asks for a new one. The host waits once a bundle, and shows its frames one after the other.
struct CudaSimulator::Impl {
  explicit Impl(const nn::Weights& file)
      : model(make_frame_model(file)), config(model->feature_config()), normalization(read_normalization(file)) {
    for (cudaStream_t* one : {&stream, &group_stream}) GRAUPEL_CUDA_CHECK(cudaStreamCreate(one));
    for (cudaEvent_t* event : {&room_beside, &groups_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
    GRAUPEL_CUDA_CHECK(cudaMallocHost(&seen, sizeof(FrameStatus)));
    for (cudaEvent_t& event : events) GRAUPEL_CUDA_CHECK(cudaEventCreate(&event));
  }
  ~Impl() {
    drop_graph();
    for (cudaEvent_t event : events) cudaEventDestroy(event);
    for (cudaEvent_t event : {room_beside, groups_there}) cudaEventDestroy(event);
    cudaFreeHost(seen);
    for (cudaStream_t one : {group_stream, stream}) cudaStreamDestroy(one);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void mark(Mark m) {
    GRAUPEL_CUDA_CHECK(
        cudaEventRecordWithFlags(events[m], stream, recording ? cudaEventRecordExternal : cudaEventRecordDefault));
  }
  /// History and the frames to come.
  int32_t ring_frames() const { return static_cast<int32_t>(config.history + 1 + config.bundle); }
  /// The newest frame.
  Vec3f* current() { return model->position(); }
  FrameRing frame_ring() { return {ring.data(), particles, ring_frames(), &status.data()->newest}; }
  /// Of accelerations; without a network gravity alone.
  Normalization real_statistics() const {
    Normalization statistics = normalization;
    if (laws.network) return statistics;
    const double dt2 = scene->frame_time * scene->frame_time;
    for (int d = 0; d < 3; ++d) statistics.acceleration_mean[d] = static_cast<float>(scene->gravity[d] * dt2);
    return statistics;
  }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream)); }
  void drop_graph() {
    if (graph) cudaGraphExecDestroy(graph);
    graph = nullptr;
  }
  void launch_graph();
  void launch_network();
  void launch_move(int64_t frame);
  void launch_bundle();
  bool ensure_capacity();
  void record_bundle();

  std::unique_ptr<FrameModel> model;
  FeatureConfig config;
  Normalization normalization;
  cudaStream_t stream = nullptr, group_stream = nullptr;
  cudaEvent_t room_beside = nullptr, groups_there = nullptr;
  cudaGraphExec_t graph = nullptr;
  cudaEvent_t events[marks] = {};
  bool recording = false;

  const Scene* scene = nullptr;
  const Environment* environment = nullptr;
  CudaLaws laws;
  int64_t particles = 0;
  Buffer<int32_t> material{Device::cuda, 0};  ///< [particles], of networks that see constants
  /// Where no network runs: accelerations of 0 beside the mean [particles, output_width()], and no fault.
  Buffer<float> no_output{Device::cuda, 0};
  Buffer<int32_t> no_fault{Device::cuda, 1};
  const float* output() { return laws.network ? model->output() : no_output.data(); }
  const int32_t* fault() { return laws.network ? model->fault() : no_fault.data(); }
  Buffer<Vec3f> ring{Device::cuda, 0};  ///< [ring_frames(), particles]
  Buffer<FrameStatus> status{Device::cuda, 1};
  FrameStatus* seen = nullptr;  ///< the status on the host
  int32_t shown = 0;            ///< the frame of the ring that positions() gives
  /// The frame before the newest; the one to come, until it is the newest.
  Buffer<Vec3f> before{Device::cuda, 0}, next{Device::cuda, 0};
  std::optional<FreeFlight> flight;
  std::optional<DensityProjection> density;
};

/// Features and, beside what follows in the stream, the network's graph of the newest frame.
void CudaSimulator::Impl::launch_graph() {
  mark(begin);
  if (!laws.network) return mark(features_done);
  model->launch_graph(stream, /*with_counts=*/!recording);
  const FeatureRules rules(config, normalization);
  parallel_for_in(
      stream, Device::cuda, feature_parts_of_row(rules) * particles,
      WriteFeatures{rules, environment->view(Device::cuda), config.material_constants ? material.data() : nullptr,
                    frame_ring(), model->features()});
  mark(features_done);
}

/// The groups of what flies are found beside it; without a network alone.
void CudaSimulator::Impl::launch_network() {
  if (!laws.network) {
    mark(hierarchy_done);
    if (flight) flight->find_groups(before.data(), current(), stream);
    return mark(network_done);
  }
  const auto find_groups = [&] {
    if (!flight) return;
    GRAUPEL_CUDA_CHECK(cudaEventRecord(room_beside, stream));
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(group_stream, room_beside, 0));
    flight->find_groups(before.data(), current(), group_stream);
    GRAUPEL_CUDA_CHECK(cudaEventRecord(groups_there, group_stream));
  };
  model->launch(stream, {[&] { mark(hierarchy_done); }, find_groups});
  if (flight) GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(stream, groups_there, 0));
  mark(network_done);
}

/// From the newest frame to the next one, by the accelerations of a frame of the bundle. The density is held after the
/// last one.
void CudaSimulator::Impl::launch_move(int64_t frame) {
  const Vec3d& size = scene->domain.size;
  const auto limit = static_cast<float>(std::max({size[0], size[1], size[2]}));
  parallel_for_in(stream, Device::cuda, particles,
                  StepParticles{real_statistics(), output() + 3 * frame, static_cast<int32_t>(config.output_width()),
                                before.data(), current(), limit, fault(), status.data(), next.data()});
  if (flight && frame > 0) flight->find_groups(before.data(), current(), stream);
  if (flight) flight->correct(before.data(), current(), next.data(), stream);
  const PushParticles push{environment->swept_collision(Device::cuda), laws.project, frame_ring(), current(),
                           next.data()};
  PushLast last{push, fault(), before.data(), current(), status.data(), seen};
  if (density && frame + 1 == config.bundle) {
    parallel_for_in(stream, Device::cuda, particles, PushAndSpread{push, density->spreading(next.data(), particles)});
    density->between(next.data(), particles, stream);
    last.push.from = nullptr;
    parallel_for_in(stream, Device::cuda, particles, MoveAndPushLast{density->moving(next.data()), last});
  } else {
    parallel_for_in(stream, Device::cuda, particles, last);
  }
}

void CudaSimulator::Impl::launch_bundle() {
  launch_graph();
  launch_network();
  for (int64_t frame = 0; frame < config.bundle; ++frame) launch_move(frame);
  mark(end);
}

/// Capacity for the graph of the newest frame; false when a particle is outside what it can hold.
bool CudaSimulator::Impl::ensure_capacity() {
  if (!laws.network) return true;
  launch_graph();
  const FrameModel::CapacityStatus capacity = model->ensure_capacity();
  if (capacity == FrameModel::CapacityStatus::reallocated) drop_graph();
  return capacity != FrameModel::CapacityStatus::exceeded;
}

/// The graph of a bundle. The network runs once before, so that all memory is there.
void CudaSimulator::Impl::record_bundle() {
  model->reuse_memory();
  launch_network();
  if (density) {  // begins each recording without pressure, so that a rollout is the same every time
    next.upload(std::vector<Vec3f>(static_cast<std::size_t>(particles), Vec3f::filled(NAN)));
    density->apply(next.data(), particles, stream);
    wait();
    density->restart();
  }
  wait();
  model->reuse_memory();
  recording = true;
  cudaGraph_t captured = nullptr;
  GRAUPEL_CUDA_CHECK(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
  launch_bundle();
  GRAUPEL_CUDA_CHECK(cudaStreamEndCapture(stream, &captured));
  recording = false;
  GRAUPEL_CUDA_CHECK(cudaGraphInstantiate(&graph, captured, 0));
  GRAUPEL_CUDA_CHECK(cudaGraphDestroy(captured));
}

CudaSimulator::CudaSimulator(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
CudaSimulator::~CudaSimulator() = default;

void CudaSimulator::start(const Scene& scene, const Environment& environment, const std::vector<int32_t>& particle_type,
                          const std::vector<int32_t>& material, const std::vector<std::vector<Vec3f>>& positions,
                          const CudaLaws& laws) {
  Impl& impl = *impl_;
  impl.drop_graph();
  impl.scene = &scene;
  impl.environment = &environment;
  environment.view(Device::cuda);  // uploads the obstacles: no memory may be taken while a frame is recorded
  impl.laws = laws;
  impl.particles = static_cast<int64_t>(particle_type.size());
  const auto frames = static_cast<std::size_t>(impl.config.history) + 1;
  GRAUPEL_ASSERT(positions.size() >= frames);
  std::vector<int32_t> rows;
  for (const int32_t type : particle_type) rows.push_back(embedding_row(type));
  std::vector<Vec3f> all;
  for (std::size_t t = positions.size() - frames; t < positions.size(); ++t) {
    GRAUPEL_ASSERT(positions[t].size() == particle_type.size());
    all.insert(all.end(), positions[t].begin(), positions[t].end());
  }
  all.resize(static_cast<std::size_t>(impl.ring_frames()) * particle_type.size());
  impl.ring.upload(all);
  GRAUPEL_ASSERT(!impl.config.material_constants || material.size() == particle_type.size());
  impl.material.upload(material);
  impl.status.upload({{static_cast<int32_t>(frames) - 1, 0, 0, 0}});
  *impl.seen = {static_cast<int32_t>(frames) - 1, 0, 0, 0};
  impl.shown = impl.seen->newest;
  impl.model->start({environment.wall_low, environment.wall_low, environment.wall_high, &environment}, rows,
                    impl.stream);
  impl.before.upload(positions[positions.size() - 2]);
  device_copy(Device::cuda, impl.model->position(), Device::cpu, positions.back().data(),
              positions.back().size() * sizeof(Vec3f));
  impl.next.resize_discard(particle_type.size());
  impl.flight.reset();
  if (!laws.network) {
    impl.no_output.upload(
        std::vector<float>(static_cast<std::size_t>(impl.config.output_width()) * particle_type.size()));
    impl.no_fault.upload({0});
  }
  if (laws.free_flight) impl.flight.emplace(Device::cuda, scene, environment, particle_type);
  impl.density.reset();
  const double spacing = impl.model->spacing(), rest = rest_density(scene, positions.back(), spacing);
  if (laws.density_limit * rest > 0)
    impl.density.emplace(Device::cuda, environment, laws.density_limit * rest, spacing);
  impl.wait();
}

bool CudaSimulator::advance() {
  Impl& impl = *impl_;
  const auto show_next = [&] {  // false where there is none
    if (impl.shown == impl.seen->newest) return false;
    impl.shown = (impl.shown + 1) % impl.ring_frames();
    return true;
  };
  if (show_next()) return true;
  if (impl.seen->diverged != 0) return false;
  for (bool has_capacity = false;;) {
    if (!impl.graph) {
      if (!impl.ensure_capacity()) return false;
      impl.record_bundle();
      has_capacity = true;
    }
    GRAUPEL_CUDA_CHECK(cudaGraphLaunch(impl.graph, impl.stream));
    impl.wait();
    if (impl.seen->fault == 0) return show_next();
    GRAUPEL_ASSERT(!has_capacity);
    impl.drop_graph();  // the newest frame is still the same
  }
}

std::vector<Vec3f> CudaSimulator::accelerations() {
  Impl& impl = *impl_;
  if (!impl.ensure_capacity())
    throw InputError("a particle lies outside the domain of its scene by more than three cells of the network's grid");
  impl.model->reuse_memory();
  impl.launch_network();
  impl.wait();
  const auto width = static_cast<std::size_t>(impl.config.output_width());
  std::vector<float> output(width * static_cast<std::size_t>(impl.particles));
  device_copy(Device::cpu, output.data(), Device::cuda, impl.model->output(), output.size() * sizeof(float));
  const Normalization statistics = impl.real_statistics();
  std::vector<Vec3f> acceleration(static_cast<std::size_t>(impl.particles));
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    acceleration[i] = real_acceleration(statistics, false, output.data() + width * i);
  return acceleration;
}

void CudaSimulator::evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const std::vector<Vec3f>& position, const Vec3d& origin, std::vector<float>& output) {
  GRAUPEL_ASSERT(!position.empty() && particle_type.size() == position.size());
  Impl& impl = *impl_;
  impl.drop_graph();
  impl.wait();
  FrameModel::Range range{origin, Vec3d::filled(1e30), Vec3d::filled(-1e30), nullptr};
  for (const Vec3f& x : position)
    for (int d = 0; d < 3; ++d) {
      range.low[d] = std::min<double>(range.low[d], x[d]);
      range.high[d] = std::max<double>(range.high[d], x[d]);
    }
  std::vector<int32_t> rows;
  for (const int32_t type : particle_type) rows.push_back(embedding_row(type));
  FrameModel& model = *impl.model;
  model.start(range, rows, impl.stream);
  device_copy(Device::cuda, model.position(), Device::cpu, position.data(), position.size() * sizeof(Vec3f));
  device_copy(Device::cuda, model.features(), Device::cpu, features.data(), features.size() * sizeof(float));
  model.launch_graph(impl.stream, /*with_counts=*/true);
  if (model.ensure_capacity() == FrameModel::CapacityStatus::exceeded)
    throw InputError("the particles do not fit the network's grid on the GPU. Use --device cpu");
  model.reuse_memory();
  model.launch(impl.stream, {[] {}, [] {}});
  impl.wait();
  output.resize(static_cast<std::size_t>(impl.config.output_width()) * position.size());
  device_copy(Device::cpu, output.data(), Device::cuda, model.output(), output.size() * sizeof(float));
}

std::vector<Vec3f> CudaSimulator::positions() const {
  const auto n = static_cast<std::size_t>(impl_->particles);
  std::vector<Vec3f> frame(n);
  device_copy(Device::cpu, frame.data(), Device::cuda, impl_->ring.data() + static_cast<std::size_t>(impl_->shown) * n,
              n * sizeof(Vec3f));
  return frame;
}

CudaFrameTime CudaSimulator::frame_time() const {
  GRAUPEL_CUDA_CHECK(cudaEventSynchronize(impl_->events[end]));
  const auto between = [&](Mark a, Mark b) {
    float milliseconds = 0;
    GRAUPEL_CUDA_CHECK(cudaEventElapsedTime(&milliseconds, impl_->events[a], impl_->events[b]));
    return static_cast<double>(milliseconds) / static_cast<double>(impl_->config.bundle);
  };
  return {between(begin, features_done), between(features_done, hierarchy_done), between(hierarchy_done, network_done),
          between(network_done, end)};
}

}  // namespace graupel::graph
