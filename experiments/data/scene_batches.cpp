#include "experiments/data/scene_batches.h"

#include <fmt/format.h>
#include <atomic>
#include <chrono>
#include <deque>
#include <exception>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>

#include "core/parallel/parallel_tasks.h"
#include "core/parallel/start_task.h"
#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "core/system/unfinished_file.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

namespace {

constexpr int64_t most_attempts = 20;
constexpr std::size_t frames_a_block = 8;  ///< that are written at once: a chunk of a trajectory

/// The trajectory of one scene on its way to the disk; what is not finished is removed.
class SceneFile {
 public:
  SceneFile(std::string path, Trajectory header, const io::TrajectoryWriteOptions& write)
      : path_(std::move(path)), header_(std::move(header)), write_(write) {}

  void append(const ParticleFrame& frame, const SceneSource& source, const SceneJob& job) {
    if (!writer_) {
      writer_ = std::make_unique<io::TrajectoryWriter>(path_, header_, write_);
      part_.emplace(path_ + ".part");
      writer_->attribute("recipe", source.name());
      writer_->attribute("recipe_seed", std::to_string(source.seed()));
      writer_->parameters(source.parameters(job));
    }
    writer_->append(frame);
  }
  void finish() {
    writer_->finish();
    writer_.reset();
    part_->keep();
  }

 private:
  std::string path_;
  std::optional<UnfinishedFile> part_;  ///< once it is there and ours
  Trajectory header_;
  io::TrajectoryWriteOptions write_;
  std::unique_ptr<io::TrajectoryWriter> writer_;
};

/// Hands out the jobs and runs them on several workers.
class SceneRunner {
 public:
  SceneRunner(const SceneSource& source, const std::vector<SceneJob>& jobs, const SceneBatchOptions& options)
      : source_(source),
        options_(options),
        waiting_(jobs.begin(), jobs.end()),
        total_(static_cast<int64_t>(jobs.size())),
        progress_("generate", total_) {
    const int threads = num_threads();
    // On a GPU one worker's batch runs while the other's is prepared and finished; on the CPU each runs its own.
    workers_ = options.device == Device::cuda
                   ? 2
                   : static_cast<int>(std::max<int64_t>(1, threads / std::min<int64_t>(options.batch, threads)));
    worker_threads_ = options.device == Device::cuda ? threads : std::max(1, threads / workers_);
  }

  void run() {
    std::vector<std::thread> workers;
    workers.reserve(static_cast<std::size_t>(workers_));
    try {
      while (static_cast<int>(workers.size()) < workers_) workers.emplace_back([this] { work(); });
    } catch (const std::system_error&) {  // those that there are do all
    }
    if (workers.empty()) work();
    for (std::thread& worker : workers) worker.join();
    if (failure_) std::rethrow_exception(failure_);
    if (finished_ == total_) progress_.done();
  }

 private:
  using Jobs = std::vector<SceneJob>;
  using Files = std::vector<std::unique_ptr<SceneFile>>;
  /// Frames of a batch that are written at once; those of a diverged scene are not usable.
  struct Block {
    std::vector<std::vector<ParticleFrame>> frames;  ///< [frame][scene]
    std::vector<bool> usable;                        ///< [scene]
  };

  void work();
  Jobs take();
  void run_batch(const Jobs& jobs);
  std::vector<mpm::PreparedScene> prepare(const Jobs& jobs) const;
  Files open_files(const Jobs& jobs, const std::vector<mpm::PreparedScene>& scenes, const mpm::SceneBatch& batch) const;
  bool advance(mpm::SceneBatch& batch, const Jobs& jobs, const Files& files, std::future<void>& writing);
  void write(const Block& block, const Jobs& jobs, const Files& files) const;
  void finish(const Files& files, const std::vector<bool>& usable) const;
  void diverged(const SceneJob& job, const std::string& reason);
  bool time_is_up() const {
    return options_.minutes > 0 &&
           std::chrono::steady_clock::now() - start_ > std::chrono::duration<double, std::ratio<60>>(options_.minutes);
  }

  const SceneSource& source_;
  const SceneBatchOptions& options_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  int workers_ = 1, worker_threads_ = 1;
  std::mutex device_lock_;  ///< a GPU runs one batch at a time, and its memory need not hold more

  std::mutex lock_;  ///< of all below
  std::deque<SceneJob> waiting_;
  int64_t total_, finished_ = 0;
  double frames_done_ = 0;  ///< in units of whole scenes
  Progress progress_;
  std::exception_ptr failure_;
};

void SceneRunner::work() {
  set_num_threads(worker_threads_);  // of this thread alone
  for (Jobs jobs = take(); !jobs.empty(); jobs = take()) try {
      run_batch(jobs);
    } catch (const StoppedError&) {  // take() has no more jobs
    } catch (...) {
      const std::lock_guard hold(lock_);
      if (!failure_) failure_ = std::current_exception();
    }
}

SceneRunner::Jobs SceneRunner::take() {
  const std::lock_guard hold(lock_);
  Jobs jobs;
  if (failure_ || interrupted() || time_is_up()) return jobs;
  while (!waiting_.empty() && static_cast<int64_t>(jobs.size()) < options_.batch) {
    jobs.push_back(waiting_.front());
    waiting_.pop_front();
  }
  return jobs;
}

std::vector<mpm::PreparedScene> SceneRunner::prepare(const Jobs& jobs) const {
  std::vector<std::optional<mpm::PreparedScene>> scenes(jobs.size());
  for_each_task(jobs.size(), worker_threads_, [&](std::size_t i) {
    const SceneJob& job = jobs[i];
    mpm::SimulationOptions simulation;
    simulation.device = options_.device;
    const Scene scene = source_.scene(job);
    simulation.seed = scene.seed;
    try {
      scenes[i].emplace(scene, simulation);
    } catch (const ConfigError& error) {
      throw ConfigError(source_.text(job) + ": " + error.what());
    }
  });
  std::vector<mpm::PreparedScene> prepared;
  prepared.reserve(jobs.size());
  for (auto& scene : scenes) prepared.push_back(std::move(*scene));
  return prepared;
}

SceneRunner::Files SceneRunner::open_files(const Jobs& jobs, const std::vector<mpm::PreparedScene>& scenes,
                                           const mpm::SceneBatch& batch) const {
  Files files;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    Trajectory header;
    header.particle_type = batch.particle_type(static_cast<int>(i));
    header.materials = kept_materials(scenes[i].scene.materials, scenes[i].particles.material);
    header.frame_time = scenes[i].scene.frame_time;
    header.scene_json = io::scene_to_json(scenes[i].scene);
    header.seed = scenes[i].options.seed;
    header.made_by = "mpm";
    io::TrajectoryWriteOptions write;
    write.velocity = source_.velocities();
    write.active = scenes[i].scene.has_inactive_particles();
    write.fields = source_.fields();
    write.deflate = source_.deflate();
    files.push_back(std::make_unique<SceneFile>(options_.file(jobs[i]), std::move(header), write));
  }
  return files;
}

void SceneRunner::run_batch(const Jobs& jobs) {
  Files files;
  std::vector<std::optional<std::string>> divergence;
  std::vector<bool> usable;
  std::future<void> writing;  // waits in its destructor
  {
    std::vector<mpm::PreparedScene> scenes = prepare(jobs);
    std::unique_lock<std::mutex> hold(device_lock_, std::defer_lock);
    if (options_.device == Device::cuda) hold.lock();
    const auto batch = mpm::SceneBatch::create(scenes);
    files = open_files(jobs, scenes, *batch);
    scenes.clear();
    if (!advance(*batch, jobs, files, writing)) return;
    if (const int64_t missed = batch->statistics().loads_without_carriers; missed > 0)
      warn(fmt::format("{} loads of {}{} began where there was no matter that can move, and did nothing", missed,
                       source_.text(jobs.front()),
                       jobs.size() > 1 ? fmt::format(" and {} more", jobs.size() - 1) : ""));
    for (int i = 0; i < batch->scene_count(); ++i) {
      divergence.push_back(batch->divergence(i));
      usable.push_back(!divergence.back());
    }
  }
  writing.get();
  finish(files, usable);
  for (std::size_t i = 0; i < jobs.size(); ++i)
    if (divergence[i]) diverged(jobs[i], *divergence[i]);
  const std::lock_guard hold(lock_);
  finished_ += std::count(usable.begin(), usable.end(), true);
}

/// All frames of a batch. The solver waits for the disk only when a block of frames is full before the last one is
/// written. False when it was stopped.
bool SceneRunner::advance(mpm::SceneBatch& batch, const Jobs& jobs, const Files& files, std::future<void>& writing) {
  Block block;
  for (int64_t f = 0; f <= source_.frames(); ++f) {
    if (interrupted()) return false;
    if (f > 0) batch.advance_frame();
    block.frames.push_back(batch.frames(source_.fields()));
    {
      const std::lock_guard hold(lock_);
      if (f > 0) frames_done_ += static_cast<double>(files.size()) / static_cast<double>(source_.frames());
      progress_.update(std::min(total_, static_cast<int64_t>(frames_done_)));
    }
    if (block.frames.size() < frames_a_block && f < source_.frames()) continue;
    block.usable.clear();
    for (int i = 0; i < batch.scene_count(); ++i) block.usable.push_back(!batch.divergence(i));
    if (writing.valid()) writing.get();
    writing = start_task([this, &jobs, &files, full = std::move(block)] { write(full, jobs, files); });
    block = {};
  }
  return true;
}

void SceneRunner::write(const Block& block, const Jobs& jobs, const Files& files) const {
  for_each_task(files.size(), worker_threads_, [&](std::size_t i) {
    if (!block.usable[i]) return;
    for (const auto& frames : block.frames) files[i]->append(frames[i], source_, jobs[i]);
  });
}

void SceneRunner::finish(const Files& files, const std::vector<bool>& usable) const {
  for_each_task(files.size(), worker_threads_, [&](std::size_t i) {
    if (usable[i]) files[i]->finish();
  });
}

void SceneRunner::diverged(const SceneJob& job, const std::string& reason) {
  const std::lock_guard hold(lock_);
  options_.diverged(job, reason);
  if (source_.on_divergence() == OnDivergence::report) return;
  if (job.attempt + 1 == most_attempts)
    throw DivergedError(fmt::format("{} diverged {} times in a row. Use more substeps in the recipe's time_step",
                                    source_.text(job), most_attempts));
  waiting_.push_front({job.split, job.index, job.attempt + 1});
  frames_done_ -= 1;
}

}  // namespace

void run_scenes(const SceneSource& source, const std::vector<SceneJob>& jobs, const SceneBatchOptions& options) {
  SceneRunner(source, jobs, options).run();
}

}  // namespace graupel::experiments
