// Rollouts of many scenes (LearnedSimulator::rollout_many): which of them run together, and their trajectories.
#include <algorithm>
#include <array>
#include <exception>
#include <functional>
#include <future>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include "core/parallel/parallel_tasks.h"
#include "core/parallel/start_task.h"
#include "core/system/error.h"
#include "graph/config/network_config.h"
#include "graph/cuda_batch.h"
#include "graph/learned_simulator.h"
#include "graph/rollout_parts.h"

namespace graupel::graph {

namespace {

constexpr int64_t most_particles = int64_t{1} << 20;  ///< of a batch: about 7 KB each on the GPU
/// Of a batch's frames: 12 bytes each on the GPU, for this batch and for the one before, and 24 in its trajectories.
constexpr int64_t most_positions = int64_t{1} << 27;
constexpr double most_cells = static_cast<double>(1 << 20);  ///< of the network in a scene's domain

/// Whether the network's sums do not depend on the rows beside them.
bool takes_scenes(const nn::Weights& weights) {
  const NetworkConfig config = network_config_of(weights);
  const auto* hgn = std::get_if<HgnConfig>(&config);
  return hgn != nullptr && hgn->aggregation == Aggregation::activations;
}

using Scenes = std::vector<LearnedSimulator::SceneRollout>;

/// What the caller's progress has thrown: no error of a scene.
struct ThrownByProgress {
  std::exception_ptr error;
};

template <typename Progress, typename... Arguments>
void call_progress(const Progress& progress, const Arguments&... arguments) {
  if (!progress) return;
  try {
    progress(arguments...);
  } catch (...) {
    throw ThrownByProgress{std::current_exception()};
  }
}

/// A scene by its place in the list and its name.
std::string words_of(const Scenes& scenes, std::size_t i) { return std::to_string(i) + " '" + scenes[i].name + "'"; }
std::string one_of(const Scenes& scenes, std::size_t i) { return "scene " + words_of(scenes, i) + ": "; }
std::string all_of(const Scenes& scenes, const std::vector<std::size_t>& batch) {
  return "scenes " + words_of(scenes, batch.front()) + " to " + words_of(scenes, batch.back()) + " (" +
         std::to_string(batch.size()) + " together): ";
}

/// Runs `work`; `which` scenes goes before the text of errors.
template <typename Work>
auto named(const std::string& which, const Work& work) {
  try {
    return work();
  } catch (const ThrownByProgress& thrown) {
    std::rethrow_exception(thrown.error);
  } catch (const InputError& error) {
    throw InputError(which + error.what());
  } catch (const ConfigError& error) {
    throw ConfigError(which + error.what());
  } catch (const Error& error) {
    throw Error(error.code(), which + error.what());
  } catch (const std::runtime_error& error) {  // of CUDA
    throw Error(ExitCode::failed, which + error.what());
  }
}

int64_t particles_of(const LearnedSimulator::SceneRollout& scene) {
  return static_cast<int64_t>(scene.particle_type->size());
}

/// Lists of scenes that run together, in their order; those that fit no other one are left out.
std::vector<std::vector<std::size_t>> batches_of(const Scenes& scenes, std::vector<std::string>& alone,
                                                 int64_t most_at_once) {
  using Key = std::pair<int64_t, std::array<double, 3>>;  // frames, lower corner
  std::map<Key, std::size_t> open;                        // the list that takes more
  std::vector<std::vector<std::size_t>> batches;
  std::vector<int64_t> particles;
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    if (!alone[s].empty()) continue;
    const Vec3d& low = scenes[s].environment->wall_low;
    const int64_t frames = scenes[s].options.frames, n = particles_of(scenes[s]);
    const auto found = open.try_emplace(Key{frames, {low[0], low[1], low[2]}}, batches.size());
    std::size_t& place = found.first->second;
    const bool is_new = found.second;
    const auto has_room = [&] {
      const int64_t all = particles[place] + n;
      return static_cast<int64_t>(batches[place].size()) < most_at_once && all <= most_particles &&
             all * frames <= most_positions;
    };
    if (is_new || !has_room()) {
      place = batches.size();
      batches.emplace_back();
      particles.push_back(0);
    }
    batches[place].push_back(s);
    particles[place] += n;
  }
  std::erase_if(batches, [&](const std::vector<std::size_t>& batch) {
    if (batch.size() == 1)
      alone[batch.front()] = "no other scene fits beside it (as many frames, the same lower corner, room)";
    return batch.size() == 1;
  });
  return batches;
}

/// Of the frames that the batch has taken aside, with velocities, as rollout() has them; of the scenes of `list`.
std::vector<Trajectory> kept_trajectories(CudaBatch& batch, const Scenes& scenes, const std::vector<std::size_t>& list,
                                          const std::string& made_by) {
  std::vector<Trajectory> trajectories(list.size());
  for_each_pool_task(list.size(), [&](std::size_t k) {
    const LearnedSimulator::SceneRollout& s = scenes[list[k]];
    const int64_t frames = batch.kept_frames(k);
    Trajectory& trajectory = trajectories[k] = empty_trajectory(*s.scene, *s.particle_type, made_by);
    trajectory.frames.resize(static_cast<std::size_t>(frames) + 1);
    trajectory.frames[0] =
        make_frame(s.options.start_time, s.scene->frame_time, (*s.start)[s.start->size() - 2], s.start->back());
    if (frames < s.options.frames) trajectory.diverged_at_frame = frames + 1;
  });
  using Piece = CudaBatch::FramePiece;
  batch.read_frames([&](const std::vector<Piece>& pieces) {
    struct Frame {
      const Piece* piece;
      std::size_t of_piece;
    };
    std::vector<Frame> frames;
    for (const Piece& piece : pieces) {
      const std::size_t n = scenes[list[piece.scene]].particle_type->size();
      for (std::size_t f = 0; f * n < piece.position.size(); ++f) frames.push_back({&piece, f});
    }
    for_each_pool_task(frames.size(), [&](std::size_t i) {
      const auto& [piece, f] = frames[i];
      const LearnedSimulator::SceneRollout& s = scenes[list[piece->scene]];
      std::vector<ParticleFrame>& of_scene = trajectories[piece->scene].frames;
      const std::size_t n = s.particle_type->size(), frame = static_cast<std::size_t>(piece->first) + f;
      const double time = s.options.start_time + static_cast<double>(frame + 1) * s.scene->frame_time;
      const auto before = f == 0 ? std::span<const Vec3f>(of_scene[frame].position)  // made by an earlier call
                                 : piece->position.subspan((f - 1) * n, n);
      of_scene[frame + 1] = make_frame(time, s.scene->frame_time, before, piece->position.subspan(f * n, n));
    });
  });
  return trajectories;
}

}  // namespace

std::string LearnedSimulator::why_alone(const SceneRollout& s) const {
  const std::size_t n = s.particle_type->size();
  const RolloutOptions& options = s.options;
  check_fit(config(), *s.scene, s.environment->normal_spacing, weights_->file);
  check_start(*s.start, static_cast<std::size_t>(config().history) + 1, n);
  check_schedule(*s.scene, options.schedule, n);
  for (const int32_t type : *s.particle_type) static_cast<void>(embedding_row(type));  // its error
  if (options.device == Device::cpu) return "scenes run one after the other on a CPU";
  PrescribedPositions prescribed(*s.particle_type, s.start->back(), options.given);
  if (options.schedule != nullptr)
    prescribed.add_scripts(*options.schedule, options.start_time, s.scene->frame_time,
                           s.environment->plane.has_value());
  const ParticleLifecycle lifecycle(*s.scene, options.schedule, s.start->back(), options.active, options.start_time);
  std::string changes = what_changes(*s.environment, prescribed, lifecycle);
  if (!changes.empty()) return changes;
  const Vec3d cells = s.scene->domain.size * (1 / network_->spacing());
  return !takes_scenes(*weights_)                           ? "the network is no HGN that aggregates activations"
         : !options.network || n == 0 || options.frames < 1 ? "there is nothing to predict"
         : cells[0] * cells[1] * cells[2] > most_cells      ? "its domain is large"
                                                            : "";
}

LearnedSimulator::ManyCost LearnedSimulator::rollout_many(const std::vector<SceneRollout>& scenes,
                                                          const std::function<void(SceneResult&&)>& done,
                                                          const ManyOptions& options) const {
  std::vector<std::string> alone(scenes.size());
  for_each_task(scenes.size(), num_threads(),
                [&](std::size_t i) { alone[i] = named(one_of(scenes, i), [&] { return why_alone(scenes[i]); }); });
  ManyCost cost;
  rollout_batches(scenes, batches_of(scenes, alone, options.most_at_once), done, options, cost);
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    if (alone[i].empty()) continue;
    const SceneRollout& s = scenes[i];
    RolloutOptions own = s.options;
    own.progress = [&](int64_t frame, const FrameTiming& timing) {
      call_progress(s.options.progress, frame, timing);
      call_progress(options.progress, frame);
    };
    Trajectory trajectory =
        named(one_of(scenes, i), [&] { return rollout(*s.scene, *s.environment, *s.particle_type, *s.start, own); });
    done({i, std::move(trajectory), alone[i]});
  }
  return cost;
}

void LearnedSimulator::rollout_batches(const std::vector<SceneRollout>& scenes,
                                       const std::vector<std::vector<std::size_t>>& batches,
                                       const std::function<void(SceneResult&&)>& done, const ManyOptions& options,
                                       ManyCost& cost) const {
  const std::vector<std::size_t>* last = nullptr;  // of which the trajectories are being made
  std::future<std::vector<Trajectory>> of_last;    // waits for them when it goes
  const auto give_last = [&] {
    if (last == nullptr) return;
    const std::vector<std::size_t>& list = *std::exchange(last, nullptr);
    std::vector<Trajectory> trajectories = named(all_of(scenes, list), [&] { return of_last.get(); });
    for (std::size_t k = 0; k < list.size(); ++k) {
      cost.frames += static_cast<int64_t>(trajectories[k].frames.size()) - 1;
      done({list[k], std::move(trajectories[k]), ""});
    }
  };
  for (const std::vector<std::size_t>& batch : batches) {
    named(all_of(scenes, batch), [&] { run_batch(scenes, batch, options); });
    cost.seconds += batch_->seconds();
    give_last();
    batch_->keep_frames();
    of_last = start_task([this, &scenes, &batch, threads = num_threads()] {
      set_num_threads(threads);  // of this thread
      return kept_trajectories(*batch_, scenes, batch, weights_->file);
    });
    last = &batch;
  }
  give_last();
}

void LearnedSimulator::run_batch(const std::vector<SceneRollout>& scenes, const std::vector<std::size_t>& batch,
                                 const ManyOptions& options) const {
  std::vector<std::vector<int32_t>> materials(batch.size());
  for_each_task(batch.size(), num_threads(), [&](std::size_t k) {
    const SceneRollout& s = scenes[batch[k]];
    materials[k] = seen_materials(*s.environment, *s.particle_type, s.options.material);
  });
  std::vector<CudaScene> of_batch;
  of_batch.reserve(batch.size());
  for (std::size_t k = 0; k < batch.size(); ++k) {
    const SceneRollout& s = scenes[batch[k]];
    const RolloutOptions& o = s.options;
    of_batch.push_back({s.scene,
                        s.environment,
                        s.particle_type,
                        &materials[k],
                        s.start,
                        {o.project, o.density_limit, o.free_flight, o.network}});
  }
  if (!batch_) batch_ = std::make_shared<CudaBatch>(*weights_);
  batch_->start(of_batch, scenes[batch.front()].options.frames);
  batch_->run([&](int64_t frame) { call_progress(options.progress, frame); });
}

}  // namespace graupel::graph
