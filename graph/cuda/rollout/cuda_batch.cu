#include "graph/cuda_batch.h"

#include <algorithm>

#include "core/parallel/cuda_check.h"
#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "graph/cuda/rollout/frame_model.h"
#include "graph/cuda/rollout/pinned_buffer.h"
#include "graph/cuda/rollout/recorded_graph.h"
#include "graph/cuda/rollout/scene_motion.h"

namespace graupel::graph {

namespace {

constexpr int64_t ahead = 2;  ///< bundles that are launched before the host looks at the first of them

/// Frames of scenes that have ended, on the GPU.
struct KeptFrames {
  struct Of {
    const Vec3f* first;  ///< [frames, particles]
    int64_t frames, particles;
  };
  Buffer<Vec3f> memory{Device::cuda, 0};
  std::vector<Of> of_scene;

  /// Lists of successive pieces, each list of `at_once` positions at most or of one frame; pieces lie on the GPU.
  std::vector<std::vector<CudaBatch::FramePiece>> pieces(int64_t at_once) const {
    std::vector<std::vector<CudaBatch::FramePiece>> lists;
    int64_t room = 0;
    for (std::size_t s = 0; s < of_scene.size(); ++s) {
      const auto& [from, frames, particles] = of_scene[s];
      for (int64_t first = 0; first < frames;) {
        if (lists.empty() || room < particles) {
          lists.emplace_back();
          room = at_once;
        }
        const int64_t count = std::clamp<int64_t>(room / particles, 1, frames - first);
        lists.back().push_back({s, first, {from + first * particles, static_cast<std::size_t>(count * particles)}});
        first += count;
        room -= count * particles;
      }
    }
    return lists;
  }
};

/// Lists of pieces on the host, two at a time.
class PieceReader {
 public:
  PieceReader() {
    GRAUPEL_CUDA_CHECK(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
    for (cudaEvent_t& event : copied_) GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(&event, cudaEventDisableTiming));
  }
  ~PieceReader() {
    cudaStreamSynchronize(stream_);
    for (cudaEvent_t event : copied_) cudaEventDestroy(event);
    cudaStreamDestroy(stream_);
  }
  PieceReader(const PieceReader&) = delete;
  PieceReader& operator=(const PieceReader&) = delete;

  template <typename Read>
  void run(std::vector<std::vector<CudaBatch::FramePiece>> lists, const Read& read) {
    GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream_));  // of a call whose `read` has thrown
    if (!lists.empty()) copy(lists[0], 0);
    for (std::size_t k = 0; k < lists.size(); ++k) {
      if (k + 1 < lists.size()) copy(lists[k + 1], (k + 1) % 2);
      GRAUPEL_CUDA_CHECK(cudaEventSynchronize(copied_[k % 2]));
      read(lists[k]);
    }
  }

 private:
  /// The pieces are on the host when copied_[place] has passed.
  void copy(std::vector<CudaBatch::FramePiece>& pieces, std::size_t place) {
    std::size_t all = 0;
    for (const CudaBatch::FramePiece& piece : pieces) all += piece.position.size();
    memory_[place].reserve_discard(all);
    Vec3f* to = memory_[place].data();
    for (CudaBatch::FramePiece& piece : pieces) {
      const std::span<const Vec3f> from = piece.position;
      GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(to, from.data(), from.size_bytes(), cudaMemcpyDeviceToHost, stream_));
      piece.position = {to, from.size()};
      to += from.size();
    }
    GRAUPEL_CUDA_CHECK(cudaEventRecord(copied_[place], stream_));
  }

  cudaStream_t stream_ = nullptr;
  cudaEvent_t copied_[2] = {};
  PinnedBuffer<Vec3f> memory_[2];
};

}  // namespace

/// All scenes make a bundle of frames in one recorded graph. Where a grid needs more room than there is, all stay as
/// they are in this bundle and in those launched after it, until the host has recorded another graph.
struct CudaBatch::Impl {
  explicit Impl(const nn::Weights& file)
      : weights(file), model(make_frame_model(file)), config(model->feature_config()) {
    GRAUPEL_ASSERT(model->takes_scenes());
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    for (cudaStream_t* one : {&stream, &group_stream}) GRAUPEL_CUDA_CHECK(cudaStreamCreate(one));
    for (cudaEvent_t* event : {&room_beside, &groups_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
    for (cudaEvent_t& event : launched) GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(&event, cudaEventDisableTiming));
    for (cudaEvent_t* event : {&begun, &ended}) GRAUPEL_CUDA_CHECK(cudaEventCreate(event));
  }
  ~Impl() {
    cudaStreamSynchronize(stream);
    graph.drop();
    for (cudaEvent_t event : launched) cudaEventDestroy(event);
    for (cudaEvent_t event : {room_beside, groups_there, begun, ended}) cudaEventDestroy(event);
    for (cudaStream_t one : {group_stream, stream}) cudaStreamDestroy(one);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream)); }
  SceneMotion::Rows rows(std::size_t scene) {
    const int64_t first = first_row[scene];
    return {model->position() + first, model->features() + first * (config.input_width() - config.embedding),
            model->output() + first * config.output_width(), model->fault()};
  }
  std::vector<SceneMotion::Placed> placed() {
    std::vector<SceneMotion::Placed> all;
    for (std::size_t s = 0; s < scenes; ++s) all.push_back({motion[s].get(), rows(s)});
    return all;
  }
  int64_t frames_of(std::size_t scene) const {
    return std::min<int64_t>(motion[scene]->status().newest - config.history, frames);
  }
  /// A scene that goes on; `scenes` where none does.
  std::size_t going_on() const {
    std::size_t s = 0;
    while (s < scenes && motion[s]->status().diverged != 0) ++s;
    return s;
  }
  void launch_network();
  void launch_bundle();
  void ensure_capacity();
  void record_bundle();
  void run_recorded(int64_t bundles, const std::function<void(int64_t)>& progress);

  const nn::Weights& weights;
  std::unique_ptr<FrameModel> model;
  FeatureConfig config;
  int device = 0;  ///< of all threads
  cudaStream_t stream = nullptr, group_stream = nullptr;
  cudaEvent_t room_beside = nullptr, groups_there = nullptr, begun = nullptr, ended = nullptr;
  cudaEvent_t launched[ahead] = {};
  RecordedGraph graph;
  std::vector<std::unique_ptr<SceneMotion>> motion;  ///< at least one a scene: they keep their memory
  std::size_t scenes = 0;
  std::vector<int64_t> first_row;  ///< of each scene
  std::vector<Vec3f> corner;       ///< [m] of each scene's domain
  int64_t frames = 0;
  double seconds = 0;
  PinnedBuffer<Vec3f> start_positions;   ///< of all scenes, one after the other: [start_frames, particles]
  Buffer<Vec3f> rings{Device::cuda, 0};  ///< the same with the frames to come
  KeptFrames kept;
  PieceReader reader;
};

/// The groups of what flies are found beside the coarse levels.
void CudaBatch::Impl::launch_network() {
  const auto find_groups = [&] {
    GRAUPEL_CUDA_CHECK(cudaEventRecord(room_beside, stream));
    GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(group_stream, room_beside, 0));
    SceneMotion::launch_groups(placed(), group_stream);
    GRAUPEL_CUDA_CHECK(cudaEventRecord(groups_there, group_stream));
  };
  model->launch(stream, {[] {}, find_groups});
  GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(stream, groups_there, 0));
}

void CudaBatch::Impl::launch_bundle() {
  model->launch_graph(stream, /*with_counts=*/false);
  SceneMotion::launch_features(placed(), stream);
  launch_network();
  for (int64_t frame = 0; frame < config.bundle; ++frame) SceneMotion::launch_move(placed(), frame, stream);
}

/// Capacity for the grids of the newest frames. Scenes whose particles lie outside of what it can hold stop.
void CudaBatch::Impl::ensure_capacity() {
  const auto has_capacity = [&] {
    model->launch_graph(stream, /*with_counts=*/true);
    return model->ensure_capacity() != FrameModel::CapacityStatus::exceeded;
  };
  if (has_capacity()) return;
  for (const std::size_t s : model->scenes_outside()) motion[s]->stop(corner[s], rows(s).position);
  const bool now = has_capacity();
  GRAUPEL_ASSERT(now);
}

/// The graph of a bundle. The network runs once before, so that all memory is there.
void CudaBatch::Impl::record_bundle() {
  SceneMotion::launch_features(placed(), stream);
  launch_network();
  wait();
  graph.record(stream, [&] { launch_bundle(); });
}

/// Until a grid needs more room, or so many bundles are made, or no scene goes on.
void CudaBatch::Impl::run_recorded(int64_t bundles, const std::function<void(int64_t)>& progress) {
  const auto report = [&] {  // whether the run goes on
    const std::size_t scene = going_on();
    if (scene == scenes || motion[scene]->status().fault != 0) return false;
    if (progress) progress(frames_of(scene));
    return true;
  };
  GRAUPEL_CUDA_CHECK(cudaEventRecord(begun, stream));
  for (int64_t k = 0; k < bundles; ++k) {
    graph.launch(stream);
    GRAUPEL_CUDA_CHECK(cudaEventRecord(launched[k % ahead], stream));
    if (k + 1 < ahead) continue;
    GRAUPEL_CUDA_CHECK(cudaEventSynchronize(launched[(k + 1) % ahead]));
    if (!report()) break;
  }
  GRAUPEL_CUDA_CHECK(cudaEventRecord(ended, stream));
  wait();
  float milliseconds = 0;
  GRAUPEL_CUDA_CHECK(cudaEventElapsedTime(&milliseconds, begun, ended));
  seconds += 1e-3 * static_cast<double>(milliseconds);
  report();
}

CudaBatch::CudaBatch(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
CudaBatch::~CudaBatch() = default;

void CudaBatch::start(const std::vector<CudaScene>& scenes, int64_t frames) {
  Impl& impl = *impl_;
  GRAUPEL_ASSERT(!scenes.empty() && frames > 0);
  impl.wait();
  impl.graph.drop();
  impl.scenes = scenes.size();
  impl.frames = frames;
  impl.first_row.clear();
  impl.corner.clear();
  std::vector<FrameModel::Range> ranges;
  int64_t particles = 0;
  for (const CudaScene& scene : scenes) {
    const Environment& environment = *scene.environment;
    GRAUPEL_ASSERT(!scene.particle_type->empty() && scene.laws.network);
    impl.first_row.push_back(particles);
    impl.corner.push_back(environment.wall_low.cast<float>());
    const auto n = static_cast<int64_t>(scene.particle_type->size());
    ranges.push_back({environment.wall_low, environment.wall_low, environment.wall_high, &environment, n});
    particles += n;
  }
  const Normalization normalization = read_normalization(impl.weights);
  while (impl.motion.size() < scenes.size())
    impl.motion.push_back(std::make_unique<SceneMotion>(impl.config, normalization, impl.model->spacing()));
  const int64_t start_frames = impl.motion.front()->start_frames();
  const int64_t all_frames = (frames + impl.config.bundle - 1) / impl.config.bundle * impl.config.bundle;
  const int64_t ring_frames = start_frames + all_frames;
  impl.start_positions.reserve_discard(static_cast<std::size_t>(start_frames * particles));
  impl.rings.resize_discard(static_cast<std::size_t>(ring_frames * particles));
  std::vector<int32_t> rows(static_cast<std::size_t>(particles));
  for_each_task(scenes.size(), num_threads(), [&](std::size_t s) {
    GRAUPEL_CUDA_CHECK(cudaSetDevice(impl.device));
    const int64_t first = impl.first_row[s];
    impl.motion[s]->prepare(scenes[s], impl.start_positions.data() + start_frames * first);
    std::transform(scenes[s].particle_type->begin(), scenes[s].particle_type->end(), rows.begin() + first,
                   embedding_row);
  });
  impl.model->start(ranges, rows, impl.stream);
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    const int64_t first = impl.first_row[s];
    impl.motion[s]->start(impl.rings.data() + ring_frames * first, all_frames, impl.model->position() + first,
                          impl.stream);
  }
}

void CudaBatch::run(const std::function<void(int64_t)>& progress) {
  Impl& impl = *impl_;
  impl.seconds = 0;
  for (;;) {
    const std::size_t scene = impl.going_on();
    if (scene == impl.scenes || impl.frames_of(scene) == impl.frames) break;
    if (!impl.graph) {
      impl.ensure_capacity();
      impl.record_bundle();
      continue;  // scenes may have stopped
    }
    const int64_t left = impl.frames - impl.frames_of(scene);
    impl.run_recorded((left + impl.config.bundle - 1) / impl.config.bundle, progress);
    const std::size_t still = impl.going_on();
    if (still < impl.scenes && impl.motion[still]->status().fault != 0) impl.graph.drop();
  }
}

double CudaBatch::seconds() const { return impl_->seconds; }

void CudaBatch::keep_frames() {
  Impl& impl = *impl_;
  impl.wait();
  impl.kept.of_scene.clear();
  for (std::size_t s = 0; s < impl.scenes; ++s) {
    const SceneMotion& motion = *impl.motion[s];
    impl.kept.of_scene.push_back(
        {motion.frame(static_cast<int32_t>(motion.start_frames())), impl.frames_of(s), motion.particles()});
  }
  std::swap(impl.kept.memory, impl.rings);
  impl.scenes = 0;
}

int64_t CudaBatch::kept_frames(std::size_t scene) const { return impl_->kept.of_scene[scene].frames; }

void CudaBatch::read_frames(const std::function<void(const std::vector<FramePiece>&)>& read, int64_t at_once) {
  GRAUPEL_CUDA_CHECK(cudaSetDevice(impl_->device));
  impl_->reader.run(impl_->kept.pieces(at_once), read);
}

}  // namespace graupel::graph
