#include "train/data/device_samples.h"

#include <string>

#include "core/parallel/cuda_check.h"
#include "core/parallel/parallel_for_in.h"
#include "core/system/error.h"
#include "train/data/teacher_target.h"

namespace graupel::train {

namespace {

/// Where the frames of a sample's trajectory lie.
struct SampleFrames {
  const Vec3f* position;          ///< [frames, particles]
  const Vec3f* initial_velocity;  ///< [particles] [m/s]
  const int32_t* type_row;        ///< [particles]
  const int32_t* material;        ///< [particles]; null where networks do not see constants
  const double* birth_time;       ///< [particles] [s]; null without emitters
  const Vec3f* birth_velocity;    ///< [particles] [m/s]
  const int32_t* present;         ///< [rows] particles of the sample, ascending; null: all
  int64_t particles, frame, rows;
  Vec3d gravity;      ///< [m/s^2]
  double frame_time;  ///< [s]

  GRAUPEL_HD bool is_kinematic(int64_t p) const { return graph::is_kinematic_row(type_row[p]); }
  GRAUPEL_HD int32_t material_of(int64_t p) const { return material == nullptr ? graph::no_material : material[p]; }
  GRAUPEL_HD int64_t particle(int64_t row) const { return present == nullptr ? row : present[row]; }
  /// Position at a frame that history shows: before the birth that of graph::add_past_of_born.
  GRAUPEL_HD Vec3f seen_at(int64_t t, int64_t p) const {
    if (birth_time == nullptr) return at(t, p);
    const double now = static_cast<double>(frame) * frame_time,
                 then = now - static_cast<double>(frame - t) * frame_time;
    if (!graph::was_born_between(birth_time[p], then, now)) return at(t, p);
    return graph::flight_since_birth(position[p], birth_velocity[p], gravity, then - birth_time[p]);
  }
  /// Stored position at a frame; before the first that of graph::start_history.
  GRAUPEL_HD Vec3f at(int64_t t, int64_t p) const {
    if (t >= 0) return position[t * particles + p];
    const double before = -static_cast<double>(t) * frame_time;
    const Vec3d fallen = gravity * (is_kinematic(p) ? 0 : before * before / 2);
    return (position[p].cast<double>() - initial_velocity[p].cast<double>() * before + fallen).cast<float>();
  }
};

struct SceneSample {
  SampleScene scene;
  SampleFrames frames;
  graph::SweptCollision way;
  bool is_pushed;  ///< the network's own frames are made; not in scenes that change
};

/// Scene of particle i of a batch.
GRAUPEL_HD const SceneSample& scene_of(const SceneSample* sample, int scenes, int64_t i) {
  int s = 0;
  while (s + 1 < scenes && sample[s + 1].scene.first <= i) ++s;
  return sample[s];
}

/// Particle p of a sample about the frame `newest`; see sample_rules.h.
struct TruePositions {
  const SampleFrames& frames;
  int64_t newest, p;
  GRAUPEL_HD Vec3f operator()(int j) const { return frames.at(newest + j, p); }
};

/// What the kernels write: features and targets, where the grid has the particles, and the history for pushes.
struct SampleOutput {
  float *features, *target;
  Vec3f* current;
  int32_t* type_row;
  Vec3f* history;  ///< [history + 1, particles], null where none is pushed
};

/// One particle of the batch.
struct MakeSample {
  SampleRules rules;
  const SceneSample* sample;
  int scenes;
  int64_t particles;
  SampleOutput out;
  GRAUPEL_HD void operator()(int64_t i) const {
    const SceneSample& own = scene_of(sample, scenes, i);
    const SampleFrames& frames = own.frames;
    const int64_t p = frames.particle(i - own.scene.first);
    Vec3f position[graph::most_positions];
    for (int t = 0; t <= rules.features.history; ++t)
      position[t] = frames.seen_at(frames.frame - rules.features.history + t, p);
    out.current[i] = write_disturbed_sample(rules, own.scene, static_cast<uint64_t>(p), frames.is_kinematic(p),
                                            frames.material_of(p), position, TruePositions{frames, frames.frame, p},
                                            out.features + i * rules.features.width, out.target + 3 * rules.bundle * i);
    out.type_row[i] = frames.type_row[p];
    if (out.history)
      for (int t = 0; t <= rules.features.history; ++t) out.history[t * particles + i] = position[t];
  }
};

/// The same one bundle of the network's later. Samples that are not pushed stay as they are.
struct PushSample {
  SampleRules rules;
  const SceneSample* sample;
  int scenes;
  int64_t particles, push;
  const float* acceleration;
  graph::Normalization normalization;  ///< of the acceleration
  SampleOutput out;
  GRAUPEL_HD void operator()(int64_t i) const {
    const SceneSample& own = scene_of(sample, scenes, i);
    if (!own.is_pushed) return;
    const SampleFrames& frames = own.frames;
    const int64_t p = i - own.scene.first;
    Vec3f position[graph::most_positions];
    for (int t = 0; t <= rules.features.history; ++t) position[t] = out.history[t * particles + i];
    const TruePositions truth{frames, frames.frame + push * rules.bundle, p};
    const Vec3f next = push_forward(rules, own.scene, own.way, frames.is_kinematic(p), normalization,
                                    acceleration + 3 * rules.bundle * i, truth, position);
    for (int t = 0; t <= rules.features.history; ++t) out.history[t * particles + i] = position[t];
    out.current[i] = write_sample(rules, own.scene, frames.material_of(p), position, next, truth,
                                  out.features + i * rules.features.width, out.target + 3 * rules.bundle * i);
  }
};

struct ResidentTrajectory {
  explicit ResidentTrajectory(Device device)
      : position(device, 0),
        initial_velocity(device, 0),
        birth_velocity(device, 0),
        birth_time(device, 0),
        type_row(device, 0),
        material(device, 0) {}
  Buffer<Vec3f> position, initial_velocity, birth_velocity;
  Buffer<double> birth_time;
  Buffer<int32_t> type_row, material;
};
using ResidentData = std::vector<ResidentTrajectory>;

ResidentData load(const DataSplit& split, Device device) {
  ResidentData resident;
  for (int i = 0; i < split.count(); ++i) {
    const TrajectoryInfo& info = split.trajectory(i);
    std::vector<Vec3f> all;
    all.reserve(static_cast<std::size_t>(info.frames) * info.type_row.size());
    for (const std::vector<Vec3f>& frame : split.positions(i, 0, info.frames))
      all.insert(all.end(), frame.begin(), frame.end());
    ResidentTrajectory trajectory(device);
    trajectory.position.upload(all);
    trajectory.initial_velocity.upload(info.initial_velocity);
    trajectory.birth_time.upload(info.schedule.birth_time);
    trajectory.birth_velocity.upload(info.schedule.birth_velocity);
    trajectory.type_row.upload(info.type_row);
    trajectory.material.upload(info.material);
    resident.push_back(std::move(trajectory));
  }
  return resident;
}

/// What the samples of a batch need beside the trajectories, on the host: where each sample's part begins, and all
/// parts.
struct HostBatch {
  std::vector<SceneSample> samples;
  std::vector<SampleGraph::Scene> scenes;
  std::vector<int32_t> present;
  std::vector<float> counted;  ///< [particles]
  int64_t uncounted = 0;
  std::vector<sparsegrid::ObstacleView> obstacles;
  std::vector<RigidMap> carried_from;
  std::vector<sparsegrid::CarriedNormalsView> normals;
  struct Begin {
    std::size_t present, obstacles, normals;
  };
  std::vector<Begin> begin;  ///< [samples]

  void append(const graph::EnvironmentPose& pose) {
    obstacles.insert(obstacles.end(), pose.obstacles.begin(), pose.obstacles.end());
    carried_from.insert(carried_from.end(), pose.carried_from.begin(), pose.carried_from.end());
    normals.insert(normals.end(), pose.normals.begin(), pose.normals.end());
  }
};

#ifdef __CUDACC__
constexpr bool with_cuda = true;
#else
constexpr bool with_cuda = false;
#endif

}  // namespace

/// Memory of one batch.
struct DeviceSamples::Slot {
  Slot(Device device, const NetworkConfig& config)
      : graph(make_sample_graph(config, device)),
        samples(device, 0),
        features(device, 0),
        target(device, 0),
        current(device, 0),
        history(device, 0),
        type_row(device, 0),
        present(device, 0),
        counted(device, 0),
        obstacles(device, 0),
        carried_from(device, 0),
        normals(device, 0) {}
  SampleOutput output() {
    return {features.data(), target.data(), current.data(), type_row.data(), pushes > 0 ? history.data() : nullptr};
  }
  void build_graph(const SampleRules& rules, void* in) {
    graph->build(rules.features, {current.data(), features.data(), type_row.data()}, in);
  }
  std::unique_ptr<SampleGraph> graph;
  Buffer<SceneSample> samples;
  Buffer<float> features, target;
  Buffer<Vec3f> current, history;
  Buffer<int32_t> type_row, present;
  Buffer<float> counted;
  Buffer<sparsegrid::ObstacleView> obstacles;
  Buffer<RigidMap> carried_from;
  Buffer<sparsegrid::CarriedNormalsView> normals;
  int64_t particles = 0, uncounted = 0, step = 0, pushes = 0;
#ifdef __CUDACC__
  cudaEvent_t released = nullptr;  ///< the launches that read this batch are done
#endif
};

struct DeviceSamples::Impl {
  Impl(const DataSplit& data, const TrainConfig& train_config, const graph::Normalization& normalization, Device where,
       BatchShard rank_shard, std::shared_ptr<const ResidentData> loaded);

  const DataSplit& split;
  TrainConfig config;
  SampleRules rules;
  Device device;
  BatchShard shard;
  std::shared_ptr<const ResidentData> resident;
  std::vector<Buffer<Vec3f>> point;  ///< of each trajectory, where obstacle particles are part of the graph
  std::array<Slot, 2> slots;
  int64_t started = 0, taken = 0;
  void* stream = nullptr;

  Slot& slot(int64_t number) { return slots[static_cast<std::size_t>(number % 2)]; }
  SceneSample sample_of(const SampleDraw& draw, int64_t first) const;
  void add_sample(const SampleDraw& draw, int64_t first, HostBatch& batch) const;
  void upload(HostBatch& batch, Slot& slot) const;
};

uint64_t DeviceSamples::bytes_for(const DataSplit& split) {
  uint64_t bytes = 0;
  for (int i = 0; i < split.count(); ++i) {
    const TrajectoryInfo& info = split.trajectory(i);
    bytes += info.type_row.size() * (sizeof(Vec3f) * (static_cast<uint64_t>(info.frames) + 1) + sizeof(int32_t)) +
             info.material.size() * sizeof(int32_t) +
             info.schedule.birth_time.size() * (sizeof(double) + sizeof(Vec3f));
  }
  return bytes;
}

SceneSample DeviceSamples::Impl::sample_of(const SampleDraw& draw, int64_t first) const {
  const TrajectoryInfo& info = split.trajectory(draw.key.trajectory);
  const ResidentTrajectory& trajectory = (*resident)[static_cast<std::size_t>(draw.key.trajectory)];
  const Scene& scene = info.context->scene;
  const graph::Environment& environment = info.context->environment;
  const auto particles = static_cast<int64_t>(info.type_row.size());
  const bool emits = !info.schedule.birth_time.empty();
  // Where obstacles move, upload() makes the view.
  return {{first, draw.stream, draw.symmetry, draw.displacement, draw.drift,
           environment.moves() ? graph::EnvironmentView() : environment.view(device)},
          {trajectory.position.data(), trajectory.initial_velocity.data(), trajectory.type_row.data(),
           info.material.empty() ? nullptr : trajectory.material.data(), emits ? trajectory.birth_time.data() : nullptr,
           emits ? trajectory.birth_velocity.data() : nullptr, nullptr, particles, draw.key.frame, particles,
           scene.gravity, scene.frame_time},
          environment.swept_collision(device),
          !environment.moves() && info.in_run.empty()};
}

void DeviceSamples::Impl::add_sample(const SampleDraw& draw, int64_t first, HostBatch& batch) const {
  const TrajectoryInfo& info = split.trajectory(draw.key.trajectory);
  SceneSample sample = sample_of(draw, first);
  batch.begin.push_back({batch.present.size(), batch.obstacles.size(), batch.normals.size()});
  if (info.in_run.empty() && info.kinematic.empty()) {
    batch.counted.insert(batch.counted.end(), info.type_row.size(), 1.0f);
  } else {
    const std::vector<int32_t> present = info.present(draw.key.frame);
    sample.frames.rows = static_cast<int64_t>(present.size());
    if (!info.in_run.empty()) batch.present.insert(batch.present.end(), present.begin(), present.end());
    for (const int32_t p : present) {
      const bool counts = info.counts(static_cast<std::size_t>(p), draw.key.frame, draw.key.frame + rules.bundle);
      batch.counted.push_back(counts ? 1.0f : 0.0f);
      batch.uncounted += counts ? 0 : 1;
    }
  }
  if (info.context->environment.moves()) batch.append(info.context->environment.pose_at(draw.time, device));
  SampleGraph::Scene scene{.draw = draw, .particles = sample.frames.rows, .environment = {}};
  if (!point.empty()) {
    const Buffer<Vec3f>& own = point[static_cast<std::size_t>(draw.key.trajectory)];
    scene.point = own.data();
    scene.points = static_cast<int64_t>(own.size());
  }
  batch.scenes.push_back(scene);
  batch.samples.push_back(sample);
}

/// Copies a batch to its slot; samples then know where their parts lie.
void DeviceSamples::Impl::upload(HostBatch& batch, Slot& slot) const {
  upload_in(stream, slot.present, batch.present);
  upload_in(stream, slot.obstacles, batch.obstacles);
  upload_in(stream, slot.carried_from, batch.carried_from);
  upload_in(stream, slot.normals, batch.normals);
  slot.uncounted = batch.uncounted;
  if (slot.uncounted > 0) upload_in(stream, slot.counted, batch.counted);
  for (std::size_t s = 0; s < batch.samples.size(); ++s) {
    SceneSample& sample = batch.samples[s];
    const TrajectoryInfo& info = split.trajectory(batch.scenes[s].draw.key.trajectory);
    const HostBatch::Begin& begin = batch.begin[s];
    if (!info.in_run.empty()) sample.frames.present = slot.present.data() + begin.present;
    if (info.context->environment.moves())
      sample.scene.environment = info.context->environment.view_of_pose(
          device, {slot.obstacles.data() + begin.obstacles, slot.carried_from.data() + begin.obstacles,
                   slot.normals.data() + begin.normals});
    batch.scenes[s].environment = sample.scene.environment;
  }
  upload_in(stream, slot.samples, batch.samples);
}

DeviceSamples::Impl::Impl(const DataSplit& data, const TrainConfig& train_config,
                          const graph::Normalization& normalization, Device where, BatchShard rank_shard,
                          std::shared_ptr<const ResidentData> loaded)
    : split(data),
      config(train_config),
      rules(sample_rules(train_config, normalization)),
      device(where),
      shard(rank_shard),
      resident(std::move(loaded)),
      slots{Slot(where, train_config.network()), Slot(where, train_config.network())} {
  GRAUPEL_ASSERT(device == Device::cpu || with_cuda);
  GRAUPEL_ASSERT(config.features().history <= graph::most_history);
  GRAUPEL_ASSERT(!config.features().material_constants || split.has_materials());
  for (const std::vector<Vec3f>* const points : obstacle_points(split, config.network()))
    point.emplace_back(device, 0).upload(*points);
#ifdef __CUDACC__
  if (device == Device::cuda) {
    cudaStream_t own = nullptr;
    // Beside the default stream, not ordered by it.
    GRAUPEL_CUDA_CHECK(cudaStreamCreateWithFlags(&own, cudaStreamNonBlocking));
    stream = own;
    for (Slot& slot : slots) GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(&slot.released, cudaEventDisableTiming));
  }
#endif
}

DeviceSamples::DeviceSamples(const DataSplit& split, const TrainConfig& config,
                             const graph::Normalization& normalization, Device device, BatchShard shard)
    : impl_(std::make_unique<Impl>(split, config, normalization, device, shard,
                                   std::make_shared<const ResidentData>(load(split, device)))) {}

DeviceSamples::DeviceSamples(const DeviceSamples& other, const TrainConfig& config,
                             const graph::Normalization& normalization)
    : impl_(std::make_unique<Impl>(other.impl_->split, config, normalization, other.impl_->device, other.impl_->shard,
                                   other.impl_->resident)) {}

DeviceSamples::~DeviceSamples() {
#ifdef __CUDACC__
  if (impl_->stream == nullptr) return;
  cudaDeviceSynchronize();
  for (Slot& slot : impl_->slots) cudaEventDestroy(slot.released);
  cudaStreamDestroy(static_cast<cudaStream_t>(impl_->stream));
#endif
}

void DeviceSamples::start(int64_t step) {
  Impl& impl = *impl_;
  GRAUPEL_ASSERT(impl.started - impl.taken < 2);
  Slot& slot = impl.slot(impl.started++);
#ifdef __CUDACC__
  if (impl.stream) GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(static_cast<cudaStream_t>(impl.stream), slot.released, 0));
#endif
  HostBatch batch;
  slot.particles = 0;
  slot.step = step;
  slot.pushes = pushes_of(impl.config, step);
  for (int64_t k = impl.shard.first; k < impl.config.batch_scenes; k += impl.shard.stride) {
    impl.add_sample(draw_training_sample(impl.split, impl.config, step, k), slot.particles, batch);
    slot.particles += batch.samples.back().frames.rows;
  }
  impl.upload(batch, slot);
  slot.graph->prepare(batch.scenes, impl.stream);
  const auto n = static_cast<std::size_t>(slot.particles), rows = static_cast<std::size_t>(slot.graph->most_rows());
  slot.features.resize_discard(rows * static_cast<std::size_t>(impl.rules.features.width));
  slot.target.resize_discard(3 * n * static_cast<std::size_t>(impl.rules.bundle));
  slot.current.resize_discard(rows);
  slot.type_row.resize_discard(rows);
  if (slot.pushes > 0) slot.history.resize_discard(n * static_cast<std::size_t>(impl.rules.features.history + 1));
  parallel_for_in(impl.stream, impl.device, slot.particles,
                  MakeSample{impl.rules, slot.samples.data(), static_cast<int>(slot.samples.size()), slot.particles,
                             slot.output()});
  slot.build_graph(impl.rules, impl.stream);
}

SampleArrays DeviceSamples::take() {
  GRAUPEL_ASSERT(impl_->taken < impl_->started);
  return arrays_of(impl_->slot(impl_->taken++), impl_->stream);
}

SampleArrays DeviceSamples::push(const float* acceleration, const graph::Normalization& normalization, int64_t push) {
  Impl& impl = *impl_;
  Slot& slot = impl.slot(impl.taken - 1);
  GRAUPEL_ASSERT(push >= 1 && push <= slot.pushes);
  // In the default stream, where the network works on the batch.
  parallel_for_in(nullptr, impl.device, slot.particles,
                  PushSample{impl.rules, slot.samples.data(), static_cast<int>(slot.samples.size()), slot.particles,
                             push, acceleration, normalization, slot.output()});
  slot.build_graph(impl.rules, nullptr);
  return arrays_of(slot, nullptr);
}

void DeviceSamples::mix_targets(const float* acceleration, const graph::Normalization& normalization, double share) {
  Impl& impl = *impl_;
  Slot& slot = impl.slot(impl.taken - 1);
  parallel_for_in(nullptr, impl.device, slot.particles * impl.rules.bundle,
                  TeacherTarget{normalization, impl.rules.features.normalization, static_cast<float>(share),
                                acceleration, slot.target.data()});
}

SampleArrays DeviceSamples::arrays_of(const Slot& slot, void* stream) const {
  SampleArrays arrays;
  slot.graph->finish(arrays, stream);
  if (arrays.counts.overflow)
    throw InputError("'" + impl_->split.file() + "': a particle of training step " + std::to_string(slot.step) +
                     " lies outside the domain of its scene by more than three cells of the network's grid. Generate " +
                     "the data set anew, or lower noise_std");
  arrays.particles = slot.particles;
  arrays.uncounted = slot.uncounted;
  arrays.feature_width = impl_->rules.features.width;
  arrays.target_width = 3 * impl_->rules.bundle;
  arrays.features = slot.features.data();
  arrays.target = slot.target.data();
  if (slot.uncounted > 0) arrays.counted = slot.counted.data();
  arrays.type_row = slot.type_row.data();
  return arrays;
}

void DeviceSamples::release() {
#ifdef __CUDACC__
  if (impl_->stream) GRAUPEL_CUDA_CHECK(cudaEventRecord(impl_->slot(impl_->taken - 1).released, nullptr));
#endif
}

}  // namespace graupel::train
