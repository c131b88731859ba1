#include "graph/cuda/cuda_simulator.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/cuda_check.h"
#include "core/error.h"
#include "core/parallel_for_in.h"
#include "graph/cuda/device_weights.h"
#include "graph/cuda/hgn_passes.h"
#include "graph/cuda/row_arena.h"
#include "graph/density_projection.h"
#include "graph/grid_builder.h"
#include "graph/hierarchical_graph_network.h"
#include "graph/level_places.h"
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

struct WriteFeatures {
  FeatureRules rules;
  SurroundingsView surroundings;
  FrameRing ring;
  float* features;
  Vec3f* now;
  GRAUPEL_HD void operator()(int64_t i) const {
    Vec3f position[most_history + 1];
    for (int t = 0; t <= rules.history; ++t) position[t] = ring.at(rules.history - t, i);
    write_feature_row(rules, surroundings, AxisMap{}, position, features + i * rules.width);
    now[i] = position[rules.history];
  }
};

GRAUPEL_HD Vec3f acceleration_of(const Normalization& statistics, const float* output) {
  Vec3f acceleration;
  for (int d = 0; d < 3; ++d)
    acceleration[d] = output[d] * statistics.acceleration_std[d] + statistics.acceleration_mean[d];
  return acceleration;
}

/// v' = v + a, x' = x + v' in frame units (step_frame), then out of obstacles and into the walls. The frame to come, or
/// `next` where that is to be changed still.
struct MoveParticles {
  Normalization statistics;
  const float* output;  ///< of the frame, [particles, 3] in rows of `width`
  int32_t width;
  FrameRing ring;
  WayFollower way;
  bool project;
  float limit;           ///< [m/frame]
  const int32_t* fault;  ///< the output is of no use
  FrameStatus* status;
  Vec3f* next;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault != 0) return;
    const Vec3f now = ring.at(0, i), velocity = now - ring.at(1, i) + acceleration_of(statistics, output + width * i);
    if (!(norm2(velocity) <= limit * limit)) status->diverged = 1;
    Vec3f x = now + velocity;
    if (project) way.follow(now, x);
    ring.at(-1, i) = x;
    if (next) next[i] = x;
  }
};

/// After the density projection of `next`: out of obstacles again.
struct SettleParticles {
  FrameRing ring;
  WayFollower way;
  bool project;
  const int32_t* fault;
  const Vec3f* next;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (*fault != 0) return;
    Vec3f x = next[i];
    if (project) way.follow(ring.at(-1, i), x);
    ring.at(-1, i) = x;
  }
};

/// One item: the frame to come is the newest now.
struct FinishFrame {
  int32_t count;
  const int32_t* fault;
  FrameStatus* status;
  GRAUPEL_HD void operator()(int64_t) const {
    status->fault = *fault;
    if (*fault == 0 && status->diverged == 0) status->newest = (status->newest + 1) % count;
  }
};

HgnConfig checked_config(const nn::Weights& weights) {
  static_cast<void>(HierarchicalGraphNetwork(weights));  // its errors
  const HgnConfig config = HgnConfig::from_metadata(weights.metadata, weights.file);
  if (!cuda_available()) throw ConfigError("device 'cuda' is not usable (no GPU). Use --device cpu");
  if (!PackedHgn::fits(config) || config.aggregation != Aggregation::messages)
    throw ConfigError("'" + weights.file + "': networks run on a GPU with a latent width of " +
                      std::to_string(layer_width) +
                      " and sums of messages only (hgn.latent: " + std::to_string(config.latent) +
                      ", hgn.aggregation: " + word_of(config.aggregation) + "). Use --device cpu");
  return config;
}

enum Mark { begin, features_done, hierarchy_done, network_done, end, marks };

}  // namespace

/// A bundle of frames is launched once, into a graph, with room for more cells than there are; one that needs more asks
/// for a new graph. The host waits once a bundle, and shows its frames one after the other.
struct CudaSimulator::Impl {
  explicit Impl(const nn::Weights& file)
      : config(checked_config(file)),
        normalization(read_normalization(file)),
        weights(file),
        network(config, weights.fcns(), weights.get("embedding.weight")),
        builder(Device::cuda, config.spacing, static_cast<int>(config.levels)) {
    network.refresh(nullptr);
    GRAUPEL_CUDA_CHECK(cudaStreamCreate(&stream));
    GRAUPEL_CUDA_CHECK(cudaStreamCreate(&grid_stream));
    for (cudaEvent_t* event : {&features_there, &grid_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
    GRAUPEL_CUDA_CHECK(cudaMallocHost(&seen, sizeof(FrameStatus)));
    for (cudaEvent_t& event : events) GRAUPEL_CUDA_CHECK(cudaEventCreate(&event));
  }
  ~Impl() {
    drop_graph();
    for (cudaEvent_t event : events) cudaEventDestroy(event);
    for (cudaEvent_t event : {features_there, grid_there}) cudaEventDestroy(event);
    cudaFreeHost(seen);
    cudaStreamDestroy(grid_stream);
    cudaStreamDestroy(stream);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void mark(Mark m) {
    GRAUPEL_CUDA_CHECK(
        cudaEventRecordWithFlags(events[m], stream, recording ? cudaEventRecordExternal : cudaEventRecordDefault));
  }
  /// History and the frames to come.
  int32_t ring_frames() const { return static_cast<int32_t>(config.history + 1 + config.bundle); }
  FrameRing frame_ring() { return {ring.data(), particles, ring_frames(), &status.data()->newest}; }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream)); }
  void drop_graph() {
    if (graph) cudaGraphExecDestroy(graph);
    graph = nullptr;
  }
  void launch_grid();
  void launch_network();
  void launch_move(int64_t frame);
  void launch_bundle();
  bool make_room();
  void record_bundle();
  HgnGraph placed_graph() const;

  HgnConfig config;
  Normalization normalization;
  DeviceWeights weights;
  PackedHgn network;
  GridBuilder builder;
  LevelRoom room;
  LevelPlaces places{Device::cuda};
  RowArena arena;
  HgnRecord record;
  cudaStream_t stream = nullptr, grid_stream = nullptr;
  cudaEvent_t features_there = nullptr, grid_there = nullptr;
  cudaGraphExec_t graph = nullptr;
  cudaEvent_t events[marks] = {};
  bool recording = false;

  const Scene* scene = nullptr;
  const Surroundings* surroundings = nullptr;
  bool project = true;
  int64_t particles = 0;
  Buffer<Vec3f> ring{Device::cuda, 0};  ///< [ring_frames(), particles]
  Buffer<FrameStatus> status{Device::cuda, 1};
  FrameStatus* seen = nullptr;  ///< the status on the host
  int32_t shown = 0;            ///< the frame of the ring that positions() gives
  Buffer<Vec3f> now{Device::cuda, 0}, next{Device::cuda, 0};
  std::optional<DensityProjection> density;
  Buffer<int32_t> type_row{Device::cuda, 0};
  Buffer<float> features{Device::cuda, 0}, output{Device::cuda, 0};
};

HgnGraph CudaSimulator::Impl::placed_graph() const {
  const GridLinks links = builder.links();
  HgnGraph placed{};
  placed.particles = particles;
  placed.particle_count = places.particle_count();
  placed.pair_count = places.pair_count();
  placed.features = features.data();
  placed.type_row = type_row.data();
  placed.weight = links.weight;
  placed.offset = links.offset;
  placed.cell = links.cell;
  placed.pair_begin = links.pair_begin;
  placed.pair = links.pair;
  for (int l = 0; l < room.levels; ++l) {
    const PlacedLevel from = places.level(l);
    LevelLinks level{};
    level.cells = room.cells[static_cast<std::size_t>(l)];
    level.edges = room.edges[static_cast<std::size_t>(l)];
    level.cell_count = from.cell_count;
    level.edge_count = from.edge_count;
    level.edge_begin = from.edge_begin;
    level.sender = from.sender;
    level.receiver = from.receiver;
    level.slot = from.slot;
    level.parent = from.parent;
    level.octant = from.octant;
    level.child_begin = from.child_begin;
    level.child = from.child;
    placed.level.push_back(level);
  }
  return placed;
}

/// Features and, beside what follows in the stream, the grid of the newest frame.
void CudaSimulator::Impl::launch_grid() {
  mark(begin);
  parallel_for_in(stream, Device::cuda, particles,
                  WriteFeatures{FeatureRules(config, normalization), surroundings->view(Device::cuda), frame_ring(),
                                features.data(), now.data()});
  mark(features_done);
  GRAUPEL_CUDA_CHECK(cudaEventRecord(features_there, stream));
  GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(grid_stream, features_there, 0));
  builder.build(now.data(), grid_stream, /*with_counts=*/!recording);
}

void CudaSimulator::Impl::launch_network() {
  places.place(builder.links(), particles, grid_stream);
  GRAUPEL_CUDA_CHECK(cudaEventRecord(grid_there, grid_stream));
  const float* const latents = forward_to_decoder(network, placed_graph(), arena, record, stream, [&] {
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(stream, grid_there, 0));
    mark(hierarchy_done);
  });
  const FcnWeights& last = network.fcn("decoder");
  decode({.rows = particles,
          .frames = static_cast<int>(config.bundle),
          .x = latents,
          .w1 = network.tile("decoder", 0),
          .b1 = last.b1,
          .w2 = last.w2,
          .b2 = last.b2,
          .out = output.data()},
         stream);
  mark(network_done);
}

/// From the newest frame to the next one, by the accelerations of a frame of the bundle.
void CudaSimulator::Impl::launch_move(int64_t frame) {
  const Vec3d& size = scene->domain.size;
  const auto limit = static_cast<float>(std::max({size[0], size[1], size[2]}));
  const FrameRing frames = frame_ring();
  const WayFollower way = surroundings->way_follower(Device::cuda);
  parallel_for_in(
      stream, Device::cuda, particles,
      MoveParticles{normalization, output.data() + 3 * frame, static_cast<int32_t>(config.output_width()), frames, way,
                    project, limit, places.fault(), status.data(), density ? next.data() : nullptr});
  if (density) {
    density->apply(next.data(), particles, stream);
    parallel_for_in(stream, Device::cuda, particles,
                    SettleParticles{frames, way, project, places.fault(), next.data()});
  }
  parallel_for_in(stream, Device::cuda, 1, FinishFrame{frames.count, places.fault(), status.data()});
}

void CudaSimulator::Impl::launch_bundle() {
  launch_grid();
  launch_network();
  for (int64_t frame = 0; frame < config.bundle; ++frame) launch_move(frame);
  GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(seen, status.data(), sizeof(FrameStatus), cudaMemcpyDeviceToHost, stream));
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
  places.prepare(room);
  return true;
}

/// The graph of a bundle. The network runs once before, so that all memory is there.
void CudaSimulator::Impl::record_bundle() {
  arena.reset();
  launch_network();
  if (density) {  // begins each recording without pressure, so that a rollout is the same every time
    next.upload(std::vector<Vec3f>(static_cast<std::size_t>(particles), Vec3f::filled(NAN)));
    density->apply(next.data(), particles, stream);
    wait();
    density->restart();
  }
  wait();
  arena.reset();
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

void CudaSimulator::start(const Scene& scene, const Surroundings& surroundings,
                          const std::vector<int32_t>& particle_type, const std::vector<std::vector<Vec3f>>& positions,
                          bool project, double density_limit) {
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
  all.resize(static_cast<std::size_t>(impl.ring_frames()) * particle_type.size());
  impl.ring.upload(all);
  impl.status.upload({{static_cast<int32_t>(frames) - 1, 0, 0}});
  *impl.seen = {static_cast<int32_t>(frames) - 1, 0, 0};
  impl.shown = impl.seen->newest;
  const FeatureRules rules(impl.config, impl.normalization);
  impl.features.resize_discard(particle_type.size() * static_cast<std::size_t>(rules.width));
  impl.output.resize_discard(static_cast<std::size_t>(impl.config.output_width()) * particle_type.size());
  impl.now.resize_discard(particle_type.size());
  impl.next.resize_discard(particle_type.size());
  impl.density.reset();
  const double spacing = impl.config.spacing, rest = rest_density(scene, positions.back(), spacing);
  if (density_limit * rest > 0) impl.density.emplace(Device::cuda, surroundings, density_limit * rest, spacing);
  impl.builder.prepare({{surroundings.wall_low, surroundings.wall_low, surroundings.wall_high, impl.particles}},
                       impl.stream);
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
  for (;;) {
    if (!impl.graph) {
      if (!impl.make_room()) return false;
      impl.record_bundle();
    }
    GRAUPEL_CUDA_CHECK(cudaGraphLaunch(impl.graph, impl.stream));
    impl.wait();
    if (impl.seen->fault == 0) return show_next();
    impl.drop_graph();  // the newest frame is still the same
  }
}

std::vector<Vec3f> CudaSimulator::accelerations() {
  Impl& impl = *impl_;
  if (!impl.make_room())
    throw InputError("a particle lies outside the domain of its scene by more than three cells of the network's grid");
  impl.arena.reset();
  impl.launch_network();
  impl.wait();
  const std::vector<float> output = impl.output.download();
  std::vector<Vec3f> acceleration(static_cast<std::size_t>(impl.particles));
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    acceleration[i] =
        acceleration_of(impl.normalization, output.data() + static_cast<std::size_t>(impl.config.output_width()) * i);
  return acceleration;
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
