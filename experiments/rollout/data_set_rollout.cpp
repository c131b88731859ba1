#include "experiments/rollout/data_set_rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "core/system/printable.h"
#include "core/system/stopwatch.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "experiments/rollout/network_start.h"

namespace graupel::experiments {

namespace {

namespace fs = std::filesystem;
using graph::LearnedSimulator;

/// Starts that are in memory at once: several times what a GPU runs together, so that trajectories of some are made
/// while the next ones run.
constexpr int64_t scenes_at_once = 4 * LearnedSimulator::batch_scenes;
/// Or fewer, once the frames that they are compared with hold so many positions (1.6 GB).
constexpr std::size_t most_positions = std::size_t{1} << 27;

/// The folder of the trajectories that are not merged yet. It goes with this, unless an error left some of them there.
class PartsFolder {
 public:
  explicit PartsFolder(const std::string& output) : path_(output + ".parts") {
    std::error_code error;
    if (!fs::create_directory(path_, error))
      throw IoError(fmt::format(
          "the folder '{}' for unfinished trajectories cannot be made ({}). Remove what another run left there, or "
          "choose another output",
          path_.string(), error ? error.message() : "it exists"));
  }
  ~PartsFolder() {
    std::error_code ignored;
    if (!merged_ && !fs::is_empty(path_, ignored) && !ignored) {
      std::fprintf(stderr, "graupel: the trajectories that were finished are in '%s'\n", path_.c_str());
      return;
    }
    fs::remove_all(path_, ignored);
  }
  PartsFolder(const PartsFolder&) = delete;
  PartsFolder& operator=(const PartsFolder&) = delete;
  /// The trajectories are in the output.
  void set_merged() { merged_ = true; }
  std::string file(int64_t trajectory) const { return (path_ / fmt::format("{:05d}.h5", trajectory)).string(); }

 private:
  fs::path path_;
  bool merged_ = false;
};

/// What a trajectory tells at the end.
struct Row {
  std::size_t particles = 0, frames = 0;
  int64_t diverged_at_frame = -1;
  std::string alone;
  RolloutError error;
};

class DataSetRollout {
 public:
  DataSetRollout(const LearnedSimulator& simulator, const RolloutOptions& options, Device device)
      : simulator_(simulator),
        options_(options),
        device_(device),
        history_(static_cast<int>(simulator.config().history) + 1),
        parts_(options.output) {
    check_start(options, history_);
    rows_.resize(static_cast<std::size_t>(io::TrajectoryReader(options.input).count()));
  }

  void run() {
    const auto count = static_cast<int64_t>(rows_.size());
    Progress progress(fmt::format("rollout of {} trajectories", count), count);
    for (int64_t first = 0; first < count; progress.update(first))
      first += run_scenes(first, std::min(scenes_at_once, count - first));
    progress.done();
    std::vector<std::string> files;
    files.reserve(rows_.size());
    for (int64_t i = 0; i < count; ++i) files.push_back(parts_.file(i));
    io::merge_trajectories(files, options_.output);
    parts_.set_merged();
    report();
  }

 private:
  /// Runs the trajectories from `first` on, at most `most`; returns how many.
  int64_t run_scenes(int64_t first, int64_t most) {
    std::vector<RolloutStart> starts;
    starts.reserve(static_cast<std::size_t>(most));
    std::size_t positions = 0;
    for (int64_t i = 0; i < most && positions < most_positions; ++i) {
      stop_if_interrupted();
      RolloutOptions one = options_;
      one.trajectory = first + i;
      starts.push_back(rollout_start(one, history_, simulator_.config().material_constants));
      check_scene(starts.back(), options_);
      positions += starts.back().rest.size() * starts.back().particle_type.size();
      for (const std::string& line : remarks_on(simulator_, starts.back().scene)) remark("graupel: warning: " + line);
      if (leaves_free_flight(options_, starts.back())) remark(std::string("rollout: ") + free_flight_remark);
    }
    std::vector<std::unique_ptr<graph::Environment>> environments(starts.size());
    for_each_task(starts.size(), num_threads(),
                  [&](std::size_t i) { environments[i] = std::make_unique<graph::Environment>(starts[i].scene); });
    std::vector<LearnedSimulator::SceneRollout> scenes;
    scenes.reserve(starts.size());
    for (std::size_t i = 0; i < starts.size(); ++i) {
      const RolloutStart& s = starts[i];
      scenes.push_back({fmt::format("trajectory {} of {}", first + static_cast<int64_t>(i), options_.input), &s.scene,
                        environments[i].get(), &s.particle_type, &s.history, simulator_options(options_, s, device_)});
    }
    const Stopwatch watch;
    const auto cost = simulator_.rollout_many(scenes,
                                              [&](LearnedSimulator::SceneResult&& result) {
                                                take(first + static_cast<int64_t>(result.scene), starts[result.scene],
                                                     std::move(result));
                                              },
                                              {.progress = [](int64_t) { stop_if_interrupted(); }});
    seconds_ += watch.seconds();
    together_.frames += cost.frames;
    together_.seconds += cost.seconds;
    return static_cast<int64_t>(starts.size());
  }
  void take(int64_t trajectory, RolloutStart& start, LearnedSimulator::SceneResult&& result) {
    Trajectory& t = result.trajectory;
    t.materials = start.kept_materials;
    t.seed = start.seed;
    t.made_by = options_.weights;
    write_positions(parts_.file(trajectory), t);
    rows_[static_cast<std::size_t>(trajectory)] = {t.particle_count(), t.frame_count() - 1, t.diverged_at_frame,
                                                   result.alone, error_of(t, start)};
  }
  void remark(const std::string& line) {
    if (said_.insert(line).second) std::fprintf(stderr, "%s\n", printable(line).c_str());
  }
  void report() const;

  const LearnedSimulator& simulator_;
  const RolloutOptions& options_;
  Device device_;
  int history_;
  PartsFolder parts_;
  std::vector<Row> rows_;
  std::set<std::string> said_;
  double seconds_ = 0;  ///< of all rollouts, with what writes them
  LearnedSimulator::ManyCost together_;
};

/// Prints and writes to --json what was run and how far it is from the data.
void DataSetRollout::report() const {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  std::map<std::string, int64_t> alone;  // reasons
  std::string diverged;
  double first = 0, all = 0;
  std::size_t frames = 0, with_rest = 0, with_first = 0, with_all = 0;  // the last two: trajectories
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    frames += row.frames;
    if (device_ == Device::cuda && !row.alone.empty()) ++alone[row.alone];
    if (row.diverged_at_frame >= 0)
      diverged += fmt::format("{}{} at frame {}", diverged.empty() ? "" : ", ", i, row.diverged_at_frame);
    rows.push_back({{"trajectory", i},
                    {"particles", row.particles},
                    {"frames", row.frames},
                    {"diverged_at_frame", row.diverged_at_frame},
                    {"alone", row.alone}});
    if (row.error.frames == 0) continue;
    ++with_rest;
    with_first += row.error.first ? 1 : 0;
    with_all += row.error.all ? 1 : 0;
    first += row.error.first.value_or(0);
    all += row.error.all.value_or(0);
    rows.back()["position_mse_20"] = mse_json(row.error.first);
    rows.back()["position_mse_all"] = mse_json(row.error.all);
  }
  nlohmann::ordered_json json = {
      {"output", options_.output}, {"trajectories", rows_.size()}, {"frames", frames}, {"seconds", seconds_}};
  std::fprintf(stderr, "%s: %zu trajectories, %zu frames in %s\n", options_.output.c_str(), rows_.size(), frames,
               human_time(seconds_).c_str());
  if (together_.frames > 0) {
    const double each = together_.seconds / static_cast<double>(together_.frames);
    std::fprintf(stderr, "of them %lld together, %s of the GPU each\n", static_cast<long long>(together_.frames),
                 human_time(each).c_str());
    json["frames_together"] = together_.frames;
    json["gpu_seconds_per_frame"] = each;
  }
  for (const auto& [reason, count] : alone)
    std::fprintf(stderr, "%lld ran alone: %s\n", static_cast<long long>(count), reason.c_str());
  if (with_rest > 0) {
    const auto mean = [](double sum, std::size_t n) {
      return n > 0 ? std::optional(sum / static_cast<double>(n)) : std::nullopt;
    };
    const std::optional<double> mean_first = mean(first, with_first), mean_all = mean(all, with_all);
    std::fprintf(stderr, "position MSE, mean of %zu trajectories: %s over up to 20 frames, %s over all\n", with_all,
                 mse_text(mean_first).c_str(), mse_text(mean_all).c_str());
    json["position_mse_20"] = mse_json(mean_first);
    json["position_mse_all"] = mse_json(mean_all);
  }
  json["rows"] = rows;
  options_.common.write_json(json);
  if (!diverged.empty())
    throw DivergedError(
        fmt::format("rollouts diverged (trajectory {}); the frames before are in '{}'", diverged, options_.output));
}

}  // namespace

void rollout_data_set(const LearnedSimulator& simulator, const RolloutOptions& options, Device device) {
  DataSetRollout(simulator, options, device).run();
}

}  // namespace graupel::experiments
