#include "graph/cuda_simulator.h"

#include <algorithm>

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"
#include "graph/cuda/rollout/frame_model.h"
#include "graph/cuda/rollout/pinned_buffer.h"
#include "graph/cuda/rollout/recorded_graph.h"
#include "graph/cuda/rollout/scene_motion.h"

namespace graupel::graph {

namespace {

enum Mark { begin, features_done, hierarchy_done, network_done, end, marks };

}  // namespace

/// A bundle of frames is launched once, into a graph, with room for a larger network's graph than there is; one that
/// needs more asks for a new one. The host waits once a bundle, and shows its frames one after the other.
struct CudaSimulator::Impl {
  explicit Impl(const nn::Weights& file)
      : model(make_frame_model(file)),
        config(model->feature_config()),
        motion(config, read_normalization(file), model->spacing()) {
    for (cudaStream_t* one : {&stream, &group_stream}) GRAUPEL_CUDA_CHECK(cudaStreamCreate(one));
    for (cudaEvent_t* event : {&room_beside, &groups_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
    for (cudaEvent_t& event : events) GRAUPEL_CUDA_CHECK(cudaEventCreate(&event));
  }
  ~Impl() {
    graph.drop();
    for (cudaEvent_t event : events) cudaEventDestroy(event);
    for (cudaEvent_t event : {room_beside, groups_there}) cudaEventDestroy(event);
    for (cudaStream_t one : {group_stream, stream}) cudaStreamDestroy(one);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void mark(Mark m) {
    GRAUPEL_CUDA_CHECK(
        cudaEventRecordWithFlags(events[m], stream, recording ? cudaEventRecordExternal : cudaEventRecordDefault));
  }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream)); }
  std::vector<SceneMotion::Placed> placed() {
    return {{&motion,
             {model->position(), model->features(), laws.network ? model->output() : no_output.data(),
              laws.network ? model->fault() : no_fault.data()}}};
  }
  void launch_graph();
  void launch_network();
  void launch_moves();
  void launch_bundle();
  bool ensure_capacity();
  void record_bundle();

  std::unique_ptr<FrameModel> model;
  FeatureConfig config;
  SceneMotion motion;
  PinnedBuffer<Vec3f> start;            ///< [history + 1, particles]
  Buffer<Vec3f> ring{Device::cuda, 0};  ///< [history + 1 + bundle, particles]
  cudaStream_t stream = nullptr, group_stream = nullptr;
  cudaEvent_t room_beside = nullptr, groups_there = nullptr;
  RecordedGraph graph;
  cudaEvent_t events[marks] = {};
  bool recording = false;
  bool brief = false;                ///< CudaScene::brief
  double time = 0, bundle_time = 0;  ///< [s] of the newest frame; of a bundle

  CudaLaws laws;
  /// Where no network runs: accelerations of 0 beside the mean [particles, output_width()], and no fault.
  Buffer<float> no_output{Device::cuda, 0};
  Buffer<int32_t> no_fault{Device::cuda, 1};
  int32_t shown = 0;  ///< the frame of the ring that positions() gives
};

/// Features and, beside what follows in the stream, the network's graph of the newest frame.
void CudaSimulator::Impl::launch_graph() {
  mark(begin);
  if (!laws.network) return mark(features_done);
  model->launch_graph(stream, /*with_counts=*/!recording);
  SceneMotion::launch_features(placed(), stream);
  mark(features_done);
}

/// The groups of what flies are found beside it; without a network alone.
void CudaSimulator::Impl::launch_network() {
  if (!laws.network) {
    mark(hierarchy_done);
    SceneMotion::launch_groups(placed(), stream);
    return mark(network_done);
  }
  const auto find_groups = [&] {
    if (!motion.finds_groups()) return;
    GRAUPEL_CUDA_CHECK(cudaEventRecord(room_beside, stream));
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(group_stream, room_beside, 0));
    SceneMotion::launch_groups(placed(), group_stream);
    GRAUPEL_CUDA_CHECK(cudaEventRecord(groups_there, group_stream));
  };
  model->launch(stream, {[&] { mark(hierarchy_done); }, find_groups});
  if (motion.finds_groups()) GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(stream, groups_there, 0));
  mark(network_done);
}

void CudaSimulator::Impl::launch_moves() {
  for (int64_t frame = 0; frame < config.bundle; ++frame) SceneMotion::launch_move(placed(), frame, stream);
  mark(end);
}

void CudaSimulator::Impl::launch_bundle() {
  launch_graph();
  launch_network();
  launch_moves();
}

/// Capacity for the graph of the newest frame; false when a particle is outside what it can hold.
bool CudaSimulator::Impl::ensure_capacity() {
  if (!laws.network) return true;
  launch_graph();
  const FrameModel::CapacityStatus capacity = model->ensure_capacity();
  if (capacity == FrameModel::CapacityStatus::reallocated) graph.drop();
  return capacity != FrameModel::CapacityStatus::exceeded;
}

/// The graph of a bundle. The network runs once before, so that all memory is there.
void CudaSimulator::Impl::record_bundle() {
  model->reuse_memory();
  launch_network();
  wait();
  model->reuse_memory();
  recording = true;
  graph.record(stream, [&] { launch_bundle(); });
  recording = false;
}

CudaSimulator::CudaSimulator(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
CudaSimulator::~CudaSimulator() = default;

void CudaSimulator::start(const CudaScene& scene) {
  Impl& impl = *impl_;
  impl.graph.drop();
  impl.laws = scene.laws;
  impl.brief = scene.brief;
  impl.time = scene.time;
  impl.bundle_time = static_cast<double>(impl.config.bundle) * scene.scene->frame_time;
  const Environment& environment = *scene.environment;
  const std::vector<int32_t>& particle_type = *scene.particle_type;
  std::vector<int32_t> rows;
  for (const int32_t type : particle_type) rows.push_back(embedding_row(type));
  impl.model->start({{environment.wall_low, environment.wall_low, environment.wall_high, &environment,
                      static_cast<int64_t>(particle_type.size())}},
                    rows, impl.stream);
  if (!scene.laws.network) {
    impl.no_output.upload(
        std::vector<float>(static_cast<std::size_t>(impl.config.output_width()) * particle_type.size()));
    impl.no_fault.upload({0});
  }
  impl.wait();
  const std::size_t n = particle_type.size(), start_frames = static_cast<std::size_t>(impl.motion.start_frames());
  impl.start.reserve_discard(start_frames * n);
  impl.ring.resize_discard((start_frames + static_cast<std::size_t>(impl.config.bundle)) * n);
  impl.motion.prepare(scene, impl.start.data());
  impl.motion.start(impl.ring.data(), impl.config.bundle, impl.model->position(), impl.stream);
  impl.wait();
  impl.shown = impl.motion.status().newest;
}

bool CudaSimulator::advance() {
  Impl& impl = *impl_;
  const volatile FrameStatus& seen = impl.motion.status();
  const auto show_next = [&] {  // false where there is none
    if (impl.shown == seen.newest) return false;
    impl.shown = (impl.shown + 1) % impl.motion.ring_frames();
    return true;
  };
  if (show_next()) return true;
  if (seen.diverged != 0) return false;
  if (impl.motion.moves()) impl.motion.place(impl.time, impl.stream);
  for (bool has_capacity = false;;) {
    if (!impl.graph) {
      if (!impl.ensure_capacity()) return false;
      if (!impl.brief) impl.record_bundle();
      has_capacity = true;
    }
    if (impl.graph) {
      impl.graph.launch(impl.stream);
    } else {  // the graph of ensure_capacity() is this frame's
      impl.model->reuse_memory();
      impl.launch_network();
      impl.launch_moves();
    }
    impl.wait();
    if (seen.fault == 0) {
      impl.time += impl.bundle_time;
      return show_next();
    }
    GRAUPEL_ASSERT(!has_capacity);
    impl.graph.drop();  // the newest frame is still the same
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
  const auto n = static_cast<std::size_t>(impl.motion.particles());
  std::vector<float> output(width * n);
  device_copy(Device::cpu, output.data(), Device::cuda, impl.model->output(), output.size() * sizeof(float));
  const Normalization statistics = impl.motion.real_statistics();
  std::vector<Vec3f> acceleration(n);
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    acceleration[i] = real_acceleration(statistics, false, output.data() + width * i);
  return acceleration;
}

void CudaSimulator::evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const std::vector<Vec3f>& position, const Vec3d& origin, std::vector<float>& output) {
  GRAUPEL_ASSERT(!position.empty() && particle_type.size() == position.size());
  Impl& impl = *impl_;
  impl.graph.drop();
  impl.wait();
  FrameModel::Range range{origin, Vec3d::filled(1e30), Vec3d::filled(-1e30), nullptr,
                          static_cast<int64_t>(position.size())};
  for (const Vec3f& x : position)
    for (int d = 0; d < 3; ++d) {
      range.low[d] = std::min<double>(range.low[d], x[d]);
      range.high[d] = std::max<double>(range.high[d], x[d]);
    }
  std::vector<int32_t> rows;
  for (const int32_t type : particle_type) rows.push_back(embedding_row(type));
  FrameModel& model = *impl.model;
  model.start({range}, rows, impl.stream);
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
  std::vector<Vec3f> frame(static_cast<std::size_t>(impl_->motion.particles()));
  device_copy(Device::cpu, frame.data(), Device::cuda, impl_->motion.frame(impl_->shown), frame.size() * sizeof(Vec3f));
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
