#include "experiments/data/data_set.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/file_lock.h"
#include "core/system/printable.h"
#include "core/system/stopwatch.h"
#include "experiments/data/scene_batches.h"

namespace graupel::experiments {

namespace fs = std::filesystem;

namespace {

constexpr mpm::Split all_splits[] = {mpm::Split::test, mpm::Split::valid, mpm::Split::train};

bool is_complete(const fs::path& file) {
  if (!fs::exists(file)) return false;
  try {
    const io::TrajectoryReader reader(file);
    return reader.complete() && reader.attribute(0, "recovered").empty();  // a recovered one lacks frames
  } catch (const InputError&) {
    return false;  // a damaged part is made again
  }
}

/// Whether all numbers can be read: checksums of chunks tell of damage that is_complete() does not see.
bool is_whole(const fs::path& part) {
  constexpr int64_t at_once = 16;
  try {
    const io::TrajectoryReader reader(part);
    reader.initial_velocity(0);
    reader.contact_forces(0);
    const auto frames = static_cast<int64_t>(reader.header(0).frame_count());
    for (int64_t first = 0; first < frames; first += at_once)
      reader.frames(0, first, std::min(at_once, frames - first), reader.fields(0));
    return true;
  } catch (const InputError&) {
    return false;
  }
}

/// Which scenes are missing, running them, merging the splits.
class DataSet {
 public:
  DataSet(const SceneSource& source, const DataSetOptions& options)
      : source_(source), options_(options), folder_(options.folder) {}

  nlohmann::ordered_json make() {
    make_folder(folder_);
    if (fs::exists(card_file())) check_card();  // a folder that is refused stays as it is, without a lock
    run_jobs(missing_scenes());
    if (remove_damaged_parts()) run_jobs(missing_scenes());
    return merge();
  }

 private:
  /// Shards may run at once: one at a time looks at what is there, and merges.
  FileLock lock() const { return FileLock::wait(folder_ / ".lock"); }

  fs::path split_file(mpm::Split split) const { return folder_ / (std::string(mpm::name_of(split)) + ".h5"); }
  fs::path part_file(const SceneJob& job) const {
    return folder_ / "parts" / fmt::format("{}-{:05d}.h5", mpm::name_of(job.split), job.index);
  }

  std::vector<SceneJob> missing_scenes() const;
  std::vector<std::string> complete_parts(mpm::Split split) const;
  fs::path card_file() const { return folder_ / "dataset.json"; }
  nlohmann::ordered_json facts() const;
  void check_card() const;
  void note_time(double seconds) const;
  void run_jobs(const std::vector<SceneJob>& jobs);
  void log_redraw(const SceneJob& job, const std::string& reason) const;
  bool remove_damaged_parts() const;
  bool merge_split(mpm::Split split, nlohmann::ordered_json& result) const;
  nlohmann::ordered_json merge() const;
  bool are_merged(const std::vector<SceneJob>& jobs) const {
    return std::all_of(jobs.begin(), jobs.end(),
                       [this](const SceneJob& job) { return is_complete(split_file(job.split)); });
  }
  void remove_parts(mpm::Split split) const {
    for (int64_t i = 0; i < source_.count(split); ++i) fs::remove(part_file({split, i}));
  }

  const SceneSource& source_;
  const DataSetOptions& options_;
  fs::path folder_;
  std::vector<std::string> lost_;  ///< scenes that diverged and are not redrawn
};

/// The scenes of this shard that the folder lacks.
std::vector<SceneJob> DataSet::missing_scenes() const {
  const FileLock hold = lock();
  if (fs::exists(card_file()))
    check_card();
  else
    write_file_atomically(card_file(), facts().dump(2) + "\n");
  std::vector<SceneJob> jobs;
  int64_t number = 0, present = 0;
  for (const mpm::Split split : all_splits) {
    const bool merged = is_complete(split_file(split));
    for (int64_t i = 0; i < source_.count(split); ++i, ++number) {
      if (number % options_.shard.n != options_.shard.i) continue;
      if (merged || is_complete(part_file({split, i})))
        ++present;
      else
        jobs.push_back({split, i});
    }
  }
  if (present > 0) std::fprintf(stderr, "generate: %lld scenes are there already\n", static_cast<long long>(present));
  if (!jobs.empty()) make_folder(folder_ / "parts");
  return jobs;
}

std::vector<std::string> DataSet::complete_parts(mpm::Split split) const {
  std::vector<std::string> parts;
  for (int64_t i = 0; i < source_.count(split); ++i)
    if (is_complete(part_file({split, i}))) parts.push_back(part_file({split, i}));
  return parts;
}

/// What dataset.json says of the folder at its start.
nlohmann::ordered_json DataSet::facts() const {
  nlohmann::ordered_json facts = source_.card();
  facts.update({{"seed", source_.seed()},
                {"device", name_of(options_.device)},
                {"fields", source_.fields().names()},
                {"made_by", version_text()}});
  facts["made_in"] = nlohmann::ordered_json::array();
  return facts;
}

/// A folder of another recipe or seed is refused, and one of another device, on which the same scene gives other bytes.
void DataSet::check_card() const {
  const fs::path card = card_file();
  const std::string device = name_of(options_.device), fields = source_.fields().names();
  const nlohmann::ordered_json scenes = source_.card();
  const auto old = nlohmann::ordered_json::parse(read_file(card), nullptr, false);
  if (!old.is_object() || !old.contains("seed") || !old["seed"].is_number_integer())
    throw InputError("'" + card.string() +
                     "' is damaged (no JSON object with a seed). Remove it, and the scenes in the folder are taken for "
                     "those of this recipe, or choose another --output");
  bool same = old["seed"].get<uint64_t>() == source_.seed();
  for (const auto& [key, value] : scenes.items()) same = same && old.contains(key) && old[key] == value;
  if (!same)
    throw ConfigError("'" + folder_.string() +
                      "' holds a data set of another recipe or seed. Choose another --output, or remove that folder");
  if (const std::string there = old.value("device", device); there != device)
    throw ConfigError("'" + folder_.string() + "' holds a data set of another device (there " + there + ", here " +
                      device + "). Use --device " + there + ", or choose another --output");
  if (const std::string there = old.value("fields", std::string()); there != fields)
    throw ConfigError("'" + folder_.string() + "' holds a data set with other fields (there '" + there + "', here '" +
                      fields + "'). Use the same --fields, or choose another --output");
}

/// Adds the time of a run to "made_in" of dataset.json; one of before that key says nothing of the scenes that it has.
void DataSet::note_time(double seconds) const {
  const FileLock hold = lock();
  const fs::path file = card_file();
  auto card = nlohmann::ordered_json::parse(read_file(file));
  if (!card.contains("made_in")) return;
  const std::string device = hardware_name(options_.device, num_threads());
  for (auto& part : card["made_in"])
    if (part.at("device") == device) {
      part["seconds"] = part.at("seconds").get<double>() + seconds;
      return write_file_atomically(file, card.dump(2) + "\n");
    }
  card["made_in"].push_back({{"device", device}, {"seconds", seconds}});
  write_file_atomically(file, card.dump(2) + "\n");
}

void DataSet::run_jobs(const std::vector<SceneJob>& jobs) {
  SceneBatchOptions batches;
  batches.device = options_.device;
  batches.batch = options_.batch > 0 ? options_.batch : source_.default_batch(options_.device);
  batches.minutes = options_.minutes;
  batches.file = [this](const SceneJob& job) { return part_file(job).string(); };
  batches.diverged = [this](const SceneJob& job, const std::string& reason) {
    if (source_.on_divergence() == OnDivergence::redraw) return log_redraw(job, reason);
    lost_.push_back(source_.text(job) + ": " + reason);
    std::fprintf(stderr, "generate: %s\n", printable(lost_.back()).c_str());
  };
  const Stopwatch watch;
  try {
    run_scenes(source_, jobs, batches);
  } catch (const IoError&) {
    if (!are_merged(jobs)) throw;
    return;  // another run has made them meanwhile, and removed the parts
  }
  if (!jobs.empty()) note_time(watch.seconds());
  stop_if_interrupted("; run the same command again to go on", AfterStop::goes_on);
  if (lost_.empty()) return;
  std::string list;
  for (const std::string& one : lost_) list += "\n  " + one;
  throw DivergedError(fmt::format(
      "{} of {} scenes diverged, so no data set was made:{}\nWith another --output, use more substeps (--set "
      "scene.time_step.substeps_per_frame=N) or take these values out of the recipe",
      lost_.size(), jobs.size(), list));
}

void DataSet::log_redraw(const SceneJob& job, const std::string& reason) const {
  const nlohmann::ordered_json line = {
      {"split", mpm::name_of(job.split)}, {"index", job.index}, {"attempt", job.attempt}, {"redrawn_because", reason}};
  const std::string path = folder_ / "redrawn.jsonl";
  std::FILE* log = std::fopen(path.c_str(), "a");
  const bool written = log != nullptr && std::fprintf(log, "%s\n", line.dump().c_str()) > 0;
  const bool closed = log != nullptr && std::fclose(log) == 0;
  if (!written || !closed)
    throw IoError("cannot write to '" + path + "' (" + std::strerror(errno) +
                  "). Free space on that disk, or choose a folder you may write to");
  std::fprintf(stderr, "generate: %s diverged and is redrawn (%s)\n", source_.text(job).c_str(),
               printable(reason).c_str());
}

/// Whether there were any; of splits whose parts are all there, which are about to be merged.
bool DataSet::remove_damaged_parts() const {
  const FileLock hold = lock();
  bool any = false;
  for (const mpm::Split split : all_splits) {
    const std::vector<std::string> parts = complete_parts(split);
    if (static_cast<int64_t>(parts.size()) < source_.count(split)) continue;
    for (const std::string& part : parts) {
      if (is_whole(part)) continue;
      std::fprintf(stderr, "generate: '%s' is damaged and is made again\n", printable(part).c_str());
      fs::remove(part);
      any = true;
    }
  }
  return any;
}

/// Whether the split is whole.
bool DataSet::merge_split(mpm::Split split, nlohmann::ordered_json& result) const {
  const int64_t count = source_.count(split);
  if (count > 0 && !is_complete(split_file(split))) {
    const std::vector<std::string> parts = complete_parts(split);
    if (static_cast<int64_t>(parts.size()) < count) {
      std::fprintf(stderr,
                   "generate: %s has %zu of %lld scenes; run the same command (or the other shards) for the rest\n",
                   mpm::name_of(split), parts.size(), static_cast<long long>(count));
      return false;
    }
    io::merge_trajectories(parts, split_file(split));
  }
  remove_parts(split);  // also those of a run that was killed after the merge
  result[mpm::name_of(split)] = count;
  return true;
}

nlohmann::ordered_json DataSet::merge() const {
  const FileLock hold = lock();
  nlohmann::ordered_json result = {{"folder", folder_.string()}};
  bool whole = true;
  for (const mpm::Split split : all_splits) whole = merge_split(split, result) && whole;
  result["complete"] = whole;
  if (!whole) return result;
  std::error_code not_empty;  // while another run of the same shard is at work
  fs::remove(folder_ / "parts", not_empty);
  if (source_.count(mpm::Split::train) > 0)
    io::write_data_set_metadata(folder_, source_.scene({mpm::Split::train, 0}), options_.connectivity_radius);
  std::fprintf(stderr, "generate: '%s' is complete\n", folder_.c_str());
  fs::remove(folder_ / ".lock");
  return result;
}

}  // namespace

nlohmann::ordered_json make_data_set(const SceneSource& source, const DataSetOptions& options) {
  return DataSet(source, options).make();
}

}  // namespace graupel::experiments
