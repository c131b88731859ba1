#include "graph/cuda/cuda_simulator.h"

#include <algorithm>

#include "core/cuda_check.h"
#include "core/error.h"
#include "core/parallel_for_in.h"
#include "graph/cuda/hgn_passes.h"
#include "graph/grid_builder.h"
#include "graph/hierarchical_graph_network.h"
#include "graph/normalization.h"

namespace graupel::graph {

namespace {

/// Frames of the history, newest last.
struct HistoryView {
  const Vec3f* frame[most_history + 1];
};

struct WriteFeatures {
  FeatureRules rules;
  SurroundingsView surroundings;
  HistoryView history;
  float* features;
  GRAUPEL_HD void operator()(int64_t i) const {
    Vec3f position[most_history + 1];
    for (int t = 0; t <= rules.history; ++t) position[t] = history.frame[t][i];
    write_feature_row(rules, surroundings, AxisMap{}, position, features + i * rules.width);
  }
};

GRAUPEL_HD Vec3f acceleration_of(const Normalization& statistics, const float* output) {
  Vec3f acceleration;
  for (int d = 0; d < 3; ++d)
    acceleration[d] = output[d] * statistics.acceleration_std[d] + statistics.acceleration_mean[d];
  return acceleration;
}

/// v' = v + a, x' = x + v' in frame units (step_frame), then out of obstacles and into the walls.
struct MoveParticles {
  Normalization statistics;
  const float* output;
  const Vec3f *before, *now;
  WayFollower way;
  bool project;
  float limit;  ///< [m/frame]
  Vec3f* next;
  int32_t* diverged;
  GRAUPEL_HD void operator()(int64_t i) const {
    const Vec3f velocity = now[i] - before[i] + acceleration_of(statistics, output + 3 * i);
    if (!(norm2(velocity) <= limit * limit)) *diverged = 1;
    Vec3f x = now[i] + velocity;
    if (project) way.follow(now[i], x);
    next[i] = x;
  }
};

/// Rows that are given out one after the other and taken back all at once.
class RowArena : public RowMemory {
 public:
  float* rows32(int64_t rows) override { return static_cast<float*>(take(rows * layer_width * 4)); }
  uint16_t* rows16(int64_t rows) override { return static_cast<uint16_t*>(take(rows * layer_width * 2)); }
  void reset() {
    // What did not fit into one piece will the next time.
    if (pieces_.size() > 1) {
      uint64_t all = 0;
      for (const Buffer<char>& piece : pieces_) all += piece.size();
      pieces_.clear();
      pieces_.emplace_back(Device::cuda, all);
    }
    used_ = 0;
  }
  uint64_t bytes() const {
    uint64_t all = 0;
    for (const Buffer<char>& piece : pieces_) all += piece.size();
    return all;
  }

 private:
  static constexpr uint64_t least_piece = 16 << 20;
  void* take(int64_t bytes) {
    const uint64_t wanted = (static_cast<uint64_t>(bytes) + 255) / 256 * 256;
    if (pieces_.empty() || used_ + wanted > pieces_.back().size()) {
      pieces_.emplace_back(Device::cuda, std::max(wanted, least_piece));
      used_ = 0;
    }
    void* const place = pieces_.back().data() + used_;
    used_ += wanted;
    return place;
  }
  std::vector<Buffer<char>> pieces_;
  uint64_t used_ = 0;  ///< of the last piece
};

/// The weights in the GPU's memory, tensor after tensor.
class DeviceWeights {
 public:
  explicit DeviceWeights(const nn::Weights& weights) : numbers_(Device::cuda, 0) {
    std::vector<float> all;
    for (const auto& [name, tensor] : weights.tensors) {
      all.resize((all.size() + 31) / 32 * 32);
      begin_[name] = all.size();
      const std::vector<float> values = tensor.as_float();
      all.insert(all.end(), values.begin(), values.end());
      shape_[name] = tensor.shape;
    }
    numbers_.upload(all);
  }
  const float* get(const std::string& name) const { return numbers_.data() + begin_.at(name); }
  /// Every FCN of the file.
  std::map<std::string, FcnWeights> fcns() const {
    std::map<std::string, FcnWeights> fcns;
    const std::string last = ".layer1.weight";
    for (const auto& [name, shape] : shape_) {
      if (!name.ends_with(last)) continue;
      const std::string fcn = name.substr(0, name.size() - last.size());
      const bool norm = begin_.contains(fcn + ".norm.weight");
      fcns[fcn] = {get(name),
                   get(fcn + ".layer1.bias"),
                   get(fcn + ".layer2.weight"),
                   get(fcn + ".layer2.bias"),
                   norm ? get(fcn + ".norm.weight") : nullptr,
                   norm ? get(fcn + ".norm.bias") : nullptr,
                   static_cast<int32_t>(shape.at(1))};
    }
    return fcns;
  }
  uint64_t bytes() const { return numbers_.size() * sizeof(float); }

 private:
  Buffer<float> numbers_;
  std::map<std::string, std::size_t> begin_;
  std::map<std::string, std::vector<int64_t>> shape_;
};

HgnConfig checked_config(const nn::Weights& weights) {
  static_cast<void>(HierarchicalGraphNetwork(weights));  // its errors
  const HgnConfig config = HgnConfig::from_metadata(weights.metadata, weights.file);
  if (!cuda_available()) throw ConfigError("device 'cuda' is not usable (no GPU). Use --device cpu");
  if (!PackedHgn::fits(config))
    throw ConfigError("'" + weights.file + "': networks run on a GPU with a latent width of " +
                      std::to_string(layer_width) + " only (hgn.latent: " + std::to_string(config.latent) +
                      "). Use --device cpu");
  return config;
}

enum Mark { begin, features_done, hierarchy_done, network_done, end, marks };

}  // namespace

struct CudaSimulator::Impl {
  explicit Impl(const nn::Weights& file)
      : config(checked_config(file)),
        normalization(read_normalization(file)),
        weights(file),
        network(config, weights.fcns(), weights.get("embedding.weight")),
        builder(Device::cuda, config.spacing, static_cast<int>(config.levels)) {
    network.refresh(nullptr);
    for (cudaEvent_t& event : events) GRAUPEL_CUDA_CHECK(cudaEventCreate(&event));
  }
  ~Impl() {
    for (cudaEvent_t event : events) cudaEventDestroy(event);
  }
  void mark(Mark m) { GRAUPEL_CUDA_CHECK(cudaEventRecord(events[m], nullptr)); }
  const Vec3f* frame(int64_t back) const {  // 0: the newest
    const auto count = static_cast<int64_t>(ring.size());
    return ring[static_cast<std::size_t>((newest + count - back) % count)].data();
  }
  bool evaluate();
  HgnGraph graph_of(const GridCounts& counts) const;

  HgnConfig config;
  Normalization normalization;
  DeviceWeights weights;
  PackedHgn network;
  GridBuilder builder;
  RowArena arena;
  HgnRecord record;
  cudaEvent_t events[marks] = {};

  const Scene* scene = nullptr;
  const Surroundings* surroundings = nullptr;
  bool project = true;
  int64_t particles = 0;
  std::vector<Buffer<Vec3f>> ring;  ///< history + 2 frames
  int64_t newest = 0;
  Buffer<int32_t> type_row{Device::cuda, 0}, diverged{Device::cuda, 1};
  Buffer<float> features{Device::cuda, 0}, output{Device::cuda, 0};
};

HgnGraph CudaSimulator::Impl::graph_of(const GridCounts& counts) const {
  const GridLinks links = builder.links();
  HgnGraph graph{};
  graph.particles = particles;
  graph.features = features.data();
  graph.type_row = type_row.data();
  graph.weight = links.weight;
  graph.offset = links.offset;
  graph.cell = links.cell;
  graph.pair_begin = links.pair_begin;
  graph.pair = links.pair;
  int64_t cell = 0, edge = 0;
  for (int l = 0; l < counts.levels; ++l) {
    LevelLinks level{};
    level.cells = counts.cells[static_cast<std::size_t>(l)];
    level.edges = counts.edges[static_cast<std::size_t>(l)];
    level.edge_begin = links.edge_begin + cell;
    level.first_edge = static_cast<int32_t>(edge);
    level.sender = links.sender + edge;
    level.receiver = links.receiver + edge;
    level.slot = links.slot + edge;
    level.reverse = links.reverse + edge;
    level.parent = links.parent + cell;
    level.octant = links.octant + cell;
    // All cells of a level are children of the next one, and level 0 has none: children are counted as cells are.
    level.child_begin = links.child_begin + cell + level.cells;
    level.child = links.child + cell;
    level.first_child = static_cast<int32_t>(cell);
    cell += level.cells;
    edge += level.edges;
    graph.level.push_back(level);
  }
  return graph;
}

/// The network's output for the newest frame; false when a particle is outside the grid's box.
bool CudaSimulator::Impl::evaluate() {
  HistoryView history{};
  for (int64_t t = 0; t <= config.history; ++t) history.frame[t] = frame(config.history - t);
  mark(begin);
  parallel_for_in(
      nullptr, Device::cuda, particles,
      WriteFeatures{FeatureRules(config, normalization), surroundings->view(Device::cuda), history, features.data()});
  mark(features_done);
  builder.build(frame(0));
  const GridCounts counts = builder.counts();
  mark(hierarchy_done);
  if (counts.overflow) return false;
  arena.reset();
  const FcnWeights& last = network.fcn("decoder");
  const float* const latents = forward_to_decoder(network, graph_of(counts), arena, record, nullptr);
  decode({.rows = particles,
          .x = latents,
          .w1 = network.tile("decoder", 0),
          .b1 = last.b1,
          .w2 = last.w2,
          .b2 = last.b2,
          .out = output.data()},
         nullptr);
  mark(network_done);
  return true;
}

CudaSimulator::CudaSimulator(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
CudaSimulator::~CudaSimulator() = default;

void CudaSimulator::start(const Scene& scene, const Surroundings& surroundings,
                          const std::vector<int32_t>& particle_type, const std::vector<std::vector<Vec3f>>& positions,
                          bool project) {
  Impl& impl = *impl_;
  impl.scene = &scene;
  impl.surroundings = &surroundings;
  impl.project = project;
  impl.particles = static_cast<int64_t>(particle_type.size());
  const auto frames = static_cast<std::size_t>(impl.config.history) + 1;
  GRAUPEL_ASSERT(positions.size() >= frames);
  std::vector<int32_t> rows;
  for (const int32_t type : particle_type) rows.push_back(embedding_row(type));
  impl.type_row.upload(rows);
  impl.ring.clear();
  for (std::size_t t = positions.size() - frames; t < positions.size(); ++t) {
    GRAUPEL_ASSERT(positions[t].size() == particle_type.size());
    impl.ring.emplace_back(Device::cuda, 0).upload(positions[t]);
  }
  impl.newest = static_cast<int64_t>(impl.ring.size()) - 1;
  impl.ring.emplace_back(Device::cuda, particle_type.size());
  impl.diverged.fill_zero();
  const FeatureRules rules(impl.config, impl.normalization);
  impl.features.resize_discard(particle_type.size() * static_cast<std::size_t>(rules.width));
  impl.output.resize_discard(3 * particle_type.size());
  impl.builder.prepare({{surroundings.wall_low, surroundings.wall_low, surroundings.wall_high, impl.particles}});
}

bool CudaSimulator::advance() {
  Impl& impl = *impl_;
  if (!impl.evaluate()) return false;
  const Vec3d& size = impl.scene->domain.size;
  const auto limit = static_cast<float>(std::max({size[0], size[1], size[2]}));
  const int64_t next = (impl.newest + 1) % static_cast<int64_t>(impl.ring.size());
  parallel_for_in(nullptr, Device::cuda, impl.particles,
                  MoveParticles{impl.normalization, impl.output.data(), impl.frame(1), impl.frame(0),
                                impl.surroundings->way_follower(Device::cuda), impl.project, limit,
                                impl.ring[static_cast<std::size_t>(next)].data(), impl.diverged.data()});
  impl.newest = next;
  impl.mark(end);
  return impl.diverged.download().front() == 0;
}

std::vector<Vec3f> CudaSimulator::accelerations() {
  Impl& impl = *impl_;
  if (!impl.evaluate())
    throw InputError("a particle lies outside the domain of its scene by more than three cells of the network's grid");
  const std::vector<float> output = impl.output.download();
  std::vector<Vec3f> acceleration(static_cast<std::size_t>(impl.particles));
  for (std::size_t i = 0; i < acceleration.size(); ++i)
    acceleration[i] = acceleration_of(impl.normalization, output.data() + 3 * i);
  return acceleration;
}

std::vector<Vec3f> CudaSimulator::positions() const {
  return impl_->ring[static_cast<std::size_t>(impl_->newest)].download();
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

uint64_t CudaSimulator::bytes() const {
  const Impl& impl = *impl_;
  return impl.arena.bytes() + 2 * impl.weights.bytes() + impl.features.size() * sizeof(float) +
         impl.ring.size() * static_cast<uint64_t>(impl.particles) * sizeof(Vec3f);
}

}  // namespace graupel::graph
