#include "graph/cuda/cuda_simulator.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/cuda_check.h"
#include "core/error.h"
#include "core/parallel_for_in.h"
#include "graph/cuda/frame_network.h"
#include "graph/density_projection.h"
#include "graph/free_flight.h"
#include "graph/grid_builder.h"
#include "graph/hierarchical_graph_network.h"
#include "graph/normalization.h"
#include "graph/rest_density.h"

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
};

/// Item i makes part i / particles of a row, so that neighbouring threads do the same.
struct WriteFeatures {
  FeatureRules rules;
  SurroundingsView surroundings;
  FrameRing ring;
  float* features;
  GRAUPEL_HD void operator()(int64_t item) const {
    const auto part = static_cast<FeaturePart>(item / ring.particles);
    const int64_t i = item % ring.particles;
    Vec3f position[most_history + 1];
    const int first = part == FeaturePart::motion ? 0 : rules.history;
    for (int t = first; t <= rules.history; ++t) position[t] = ring.at(rules.history - t, i);
    write_feature_part(part, rules, surroundings, AxisMap{}, position, features + i * rules.width);
  }
};

GRAUPEL_HD Vec3f acceleration_of(const Normalization& statistics, const float* output) {
  Vec3f acceleration;
  for (int d = 0; d < 3; ++d)
    acceleration[d] = output[d] * statistics.acceleration_std[d] + statistics.acceleration_mean[d];
  return acceleration;
}

/// v' = v + a, x' = x + v' in frame units (step_frame).
struct StepParticles {
  Normalization statistics;
  const float* output;
  const Vec3f *before, *now;
  float limit;           ///< [m/frame]
  const int32_t* fault;  ///< the output is of no use
  FrameStatus* status;
  Vec3f* next;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault != 0) return;
    const Vec3f velocity = now[i] - before[i] + acceleration_of(statistics, output + 3 * i);
    if (!(norm2(velocity) <= limit * limit)) status->diverged = 1;
    next[i] = now[i] + velocity;
  }
};

/// Moves `next`, reached from `from`, out of obstacles and into the walls.
struct PushParticles {
  WayFollower way;
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

/// The last of it: the frame to come becomes `now`, and `now` becomes `before`, unless the output is of no use.
struct PushLast {
  PushParticles push;
  const int32_t* fault;
  Vec3f *before, *now;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault != 0) return;
    const Vec3f x = push.pushed(i);
    before[i] = now[i];
    now[i] = push.ring.at(-1, i) = x;
  }
};

/// One item: the frame to come is the newest now.
struct FinishFrame {
  int32_t count;
  const int32_t* fault;
  FrameStatus* status;
  FrameStatus* seen;  ///< on the host
  GRAUPEL_HD void operator()(int64_t) const {
    status->fault = *fault;
    if (*fault == 0 && status->diverged == 0) status->newest = (status->newest + 1) % count;
    *seen = *status;
  }
};

HgnConfig checked_config(const nn::Weights& weights) {
  static_cast<void>(HierarchicalGraphNetwork(weights));  // its errors
  if (!cuda_available()) throw ConfigError("device 'cuda' is not usable (no GPU). Use --device cpu");
  return HgnConfig::from_metadata(weights.metadata, weights.file);
}

enum Mark { begin, features_done, hierarchy_done, network_done, end, marks };

}  // namespace

/// A frame is launched once, into a graph, with room for more cells than there are; a frame that needs more asks for a
/// new graph. The host waits once a frame.
struct CudaSimulator::Impl {
  explicit Impl(const nn::Weights& file)
      : config(checked_config(file)),
        normalization(read_normalization(file)),
        network(make_frame_network(config, file)),
        builder(Device::cuda, config.spacing, static_cast<int>(config.levels), /*margin=*/3,
                config.aggregation == Aggregation::messages) {
    for (cudaStream_t* one : {&stream, &grid_stream, &group_stream}) GRAUPEL_CUDA_CHECK(cudaStreamCreate(one));
    for (cudaEvent_t* event : {&begun, &grid_there, &groups_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
    GRAUPEL_CUDA_CHECK(cudaMallocHost(&seen, sizeof(FrameStatus)));
    for (cudaEvent_t& event : events) GRAUPEL_CUDA_CHECK(cudaEventCreate(&event));
  }
  ~Impl() {
    drop_graph();
    for (cudaEvent_t event : events) cudaEventDestroy(event);
    for (cudaEvent_t event : {begun, grid_there, groups_there}) cudaEventDestroy(event);
    cudaFreeHost(seen);
    for (cudaStream_t one : {group_stream, grid_stream, stream}) cudaStreamDestroy(one);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void mark(Mark m) {
    GRAUPEL_CUDA_CHECK(
        cudaEventRecordWithFlags(events[m], stream, recording ? cudaEventRecordExternal : cudaEventRecordDefault));
  }
  FrameRing frame_ring() {
    return {ring.data(), particles, static_cast<int32_t>(config.history) + 2, &status.data()->newest};
  }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream)); }
  void drop_graph() {
    if (graph) cudaGraphExecDestroy(graph);
    graph = nullptr;
  }
  void launch_grid();
  void launch_network();
  void launch_frame();
  bool make_room();
  void record_frame();

  HgnConfig config;
  Normalization normalization;
  std::unique_ptr<FrameNetwork> network;
  GridBuilder builder;
  LevelRoom room;
  cudaStream_t stream = nullptr, grid_stream = nullptr, group_stream = nullptr;
  cudaEvent_t begun = nullptr, grid_there = nullptr, groups_there = nullptr;
  cudaGraphExec_t graph = nullptr;
  cudaEvent_t events[marks] = {};
  bool recording = false;

  const Scene* scene = nullptr;
  const Surroundings* surroundings = nullptr;
  bool project = true;
  int64_t particles = 0;
  Buffer<Vec3f> ring{Device::cuda, 0};  ///< [history + 2, particles]
  Buffer<FrameStatus> status{Device::cuda, 1};
  FrameStatus* seen = nullptr;  ///< the status on the host
  /// The last two frames; the one to come, until it is one.
  Buffer<Vec3f> before{Device::cuda, 0}, now{Device::cuda, 0}, next{Device::cuda, 0};
  std::optional<FreeFlight> flight;
  std::optional<DensityProjection> density;
  Buffer<int32_t> type_row{Device::cuda, 0};
  Buffer<float> features{Device::cuda, 0};
};

/// Features and, beside what follows in the stream, the grid of the newest frame and the groups of what flies.
void CudaSimulator::Impl::launch_grid() {
  mark(begin);
  GRAUPEL_CUDA_CHECK(cudaEventRecord(begun, stream));
  GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(grid_stream, begun, 0));
  builder.build(now.data(), grid_stream, /*with_counts=*/!recording);
  if (flight) {
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(group_stream, begun, 0));
    flight->find_groups(before.data(), now.data(), group_stream);
    GRAUPEL_CUDA_CHECK(cudaEventRecord(groups_there, group_stream));
  }
  parallel_for_in(stream, Device::cuda, feature_parts_of_row * particles,
                  WriteFeatures{FeatureRules(config, normalization), surroundings->view(Device::cuda), frame_ring(),
                                features.data()});
  mark(features_done);
}

void CudaSimulator::Impl::launch_network() {
  network->follow_grid(grid_stream);
  GRAUPEL_CUDA_CHECK(cudaEventRecord(grid_there, grid_stream));
  network->launch(stream, [&] {
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(stream, grid_there, 0));
    mark(hierarchy_done);
  });
  if (flight) GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(stream, groups_there, 0));
  mark(network_done);
}

void CudaSimulator::Impl::launch_frame() {
  launch_grid();
  launch_network();
  const Vec3d& size = scene->domain.size;
  const auto limit = static_cast<float>(std::max({size[0], size[1], size[2]}));
  const FrameRing frames = frame_ring();
  const WayFollower way = surroundings->way_follower(Device::cuda);
  parallel_for_in(stream, Device::cuda, particles,
                  StepParticles{normalization, network->output(), before.data(), now.data(), limit, network->fault(),
                                status.data(), next.data()});
  if (flight) flight->correct(before.data(), now.data(), next.data(), stream);
  PushParticles push{way, project, frames, now.data(), next.data()};
  if (density) {
    parallel_for_in(stream, Device::cuda, particles, push);
    density->apply(next.data(), particles, stream);
    push.from = nullptr;
  }
  parallel_for_in(stream, Device::cuda, particles, PushLast{push, network->fault(), before.data(), now.data()});
  parallel_for_in(stream, Device::cuda, 1, FinishFrame{frames.count, network->fault(), status.data(), seen});
  mark(end);
}

/// Room for the cells of the newest frame; false when a particle is outside the grid's box.
bool CudaSimulator::Impl::make_room() {
  launch_grid();
  const GridCounts counts = builder.counts(grid_stream);
  if (counts.overflow) return false;
  if (room.holds(counts)) return true;
  drop_graph();
  room = LevelRoom::for_counts(counts);
  network->prepare(
      {particles, features.data(), type_row.data(), now.data(), surroundings->wall_low, builder.links(), room});
  return true;
}

/// The graph of a frame. The network runs once before, so that all memory is there.
void CudaSimulator::Impl::record_frame() {
  network->reset();
  launch_network();
  if (density) {  // begins each recording without pressure, so that a rollout is the same every time
    next.upload(std::vector<Vec3f>(static_cast<std::size_t>(particles), Vec3f::filled(NAN)));
    density->apply(next.data(), particles, stream);
    wait();
    density->restart();
  }
  wait();
  network->reset();
  recording = true;
  cudaGraph_t captured = nullptr;
  GRAUPEL_CUDA_CHECK(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
  launch_frame();
  GRAUPEL_CUDA_CHECK(cudaStreamEndCapture(stream, &captured));
  recording = false;
  GRAUPEL_CUDA_CHECK(cudaGraphInstantiate(&graph, captured, 0));
  GRAUPEL_CUDA_CHECK(cudaGraphDestroy(captured));
}

CudaSimulator::CudaSimulator(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
CudaSimulator::~CudaSimulator() = default;

void CudaSimulator::start(const Scene& scene, const Surroundings& surroundings,
                          const std::vector<int32_t>& particle_type, const std::vector<std::vector<Vec3f>>& positions,
                          bool project, double density_limit, bool free_flight) {
  Impl& impl = *impl_;
  impl.drop_graph();
  impl.room = {};
  impl.scene = &scene;
  impl.surroundings = &surroundings;
  impl.project = project;
  impl.particles = static_cast<int64_t>(particle_type.size());
  const auto frames = static_cast<std::size_t>(impl.config.history) + 1;
  GRAUPEL_ASSERT(positions.size() >= frames);
  std::vector<int32_t> rows;
  for (const int32_t type : particle_type) rows.push_back(embedding_row(type));
  impl.type_row.upload(rows);
  std::vector<Vec3f> all;
  for (std::size_t t = positions.size() - frames; t < positions.size(); ++t) {
    GRAUPEL_ASSERT(positions[t].size() == particle_type.size());
    all.insert(all.end(), positions[t].begin(), positions[t].end());
  }
  all.resize((frames + 1) * particle_type.size());
  impl.ring.upload(all);
  impl.status.upload({{static_cast<int32_t>(frames) - 1, 0, 0}});
  *impl.seen = {static_cast<int32_t>(frames) - 1, 0, 0};
  const FeatureRules rules(impl.config, impl.normalization);
  impl.features.resize_discard(particle_type.size() * static_cast<std::size_t>(rules.width));
  impl.before.upload(positions[positions.size() - 2]);
  impl.now.upload(positions.back());
  impl.next.resize_discard(particle_type.size());
  impl.flight.reset();
  if (free_flight) impl.flight.emplace(Device::cuda, scene, surroundings, particle_type);
  impl.density.reset();
  const double spacing = impl.config.spacing, rest = rest_density(scene, positions.back(), spacing);
  if (density_limit * rest > 0) impl.density.emplace(Device::cuda, surroundings, density_limit * rest, spacing);
  impl.builder.prepare({{surroundings.wall_low, surroundings.wall_low, surroundings.wall_high, impl.particles}},
                       impl.stream);
  impl.wait();
}

bool CudaSimulator::advance() {
  Impl& impl = *impl_;
  for (;;) {
    if (!impl.graph) {
      if (!impl.make_room()) return false;
      impl.record_frame();
    }
    GRAUPEL_CUDA_CHECK(cudaGraphLaunch(impl.graph, impl.stream));
    impl.wait();
    if (impl.seen->fault == 0) return impl.seen->diverged == 0;
    impl.drop_graph();  // the newest frame is still the same
  }
}

std::vector<Vec3f> CudaSimulator::accelerations() {
  Impl& impl = *impl_;
  if (!impl.make_room())
    throw InputError("a particle lies outside the domain of its scene by more than three cells of the network's grid");
  impl.network->reset();
  impl.launch_network();
  impl.wait();
  std::vector<float> output(3 * static_cast<std::size_t>(impl.particles));
  device_copy(Device::cpu, output.data(), Device::cuda, impl.network->output(), output.size() * sizeof(float));
  std::vector<Vec3f> acceleration(static_cast<std::size_t>(impl.particles));
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    acceleration[i] = acceleration_of(impl.normalization, output.data() + 3 * i);
  return acceleration;
}

std::vector<Vec3f> CudaSimulator::positions() const {
  const auto n = static_cast<std::size_t>(impl_->particles);
  std::vector<Vec3f> frame(n);
  device_copy(Device::cpu, frame.data(), Device::cuda,
              impl_->ring.data() + static_cast<std::size_t>(impl_->seen->newest) * n, n * sizeof(Vec3f));
  return frame;
}

CudaFrameTime CudaSimulator::frame_time() const {
  GRAUPEL_CUDA_CHECK(cudaEventSynchronize(impl_->events[end]));
  const auto between = [&](Mark a, Mark b) {
    float milliseconds = 0;
    GRAUPEL_CUDA_CHECK(cudaEventElapsedTime(&milliseconds, impl_->events[a], impl_->events[b]));
    return static_cast<double>(milliseconds);
  };
  return {between(begin, features_done), between(features_done, hierarchy_done), between(hierarchy_done, network_done),
          between(network_done, end)};
}

}  // namespace graupel::graph
