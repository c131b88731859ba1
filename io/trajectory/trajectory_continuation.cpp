#include "io/trajectory/trajectory_continuation.h"

#include <cmath>
#include <filesystem>

#include "core/system/error.h"
#include "io/config/json_node.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

/// The scene without what does not change the motion.
std::string physics_of(const std::string& scene_json) {
  try {
    const JsonNode root = parse_json(scene_json, "scene");
    JsonNode kept = JsonNode::object();
    for (const JsonMember& member : root.members)
      if (member.key != "frames" && member.key != "name" && member.key != "description")
        kept.set(member.key, member.value);
    return write_json(kept, JsonLayout::compact);
  } catch (const Error&) {
    return scene_json;
  }
}

std::string contents_text(const TrajectoryWriteOptions& options) {
  std::string text = options.velocity ? "position, velocity" : "position";
  if (options.active) text += ", active";
  if (!options.fields.empty()) text += ", " + options.fields.names();
  if (!options.contacts.empty()) text += ", forces";
  return text;
}

std::string range_text(int64_t first, int64_t last) {
  return first == last ? "frame " + std::to_string(first)
                       : "frames " + std::to_string(first) + "-" + std::to_string(last);
}

int64_t number_of(double time, double frame_time) { return static_cast<int64_t>(std::llround(time / frame_time)); }

int64_t first_recent(const TrajectoryCheckpoint& checkpoint) {
  return checkpoint.frame + 1 - static_cast<int64_t>(checkpoint.recent.size());
}

/// Which frames the file and the checkpoint lack together, given the times of the file's; "" for none.
std::string missing_frames(const std::vector<double>& times, const TrajectoryCheckpoint& checkpoint,
                           double frame_time) {
  const int64_t begin = times.empty() ? 0 : number_of(times.front(), frame_time);
  if (begin > checkpoint.frame) return "it begins with frame " + std::to_string(begin);
  const int64_t next = begin + static_cast<int64_t>(times.size()), needed = first_recent(checkpoint);
  return next < needed ? "it lacks " + range_text(next, needed - 1) : "";
}

/// Why a file does not continue with `header` from the checkpoint; "" when it does.
std::string difference(const UnfinishedTrajectory& file, const Trajectory& header,
                       const TrajectoryWriteOptions& options, const TrajectoryCheckpoint& checkpoint) {
  const Trajectory there = file.header();
  if (there.particle_type != header.particle_type || there.materials != header.materials)
    return "it has other particles";
  if (there.seed != header.seed) return "it has another seed";
  if (there.frame_time != header.frame_time || physics_of(there.scene_json) != physics_of(header.scene_json))
    return "it is of another scene";
  const std::string has = contents_text(file.contents()), needs = contents_text(options);
  if (has != needs) return "it stores " + has + ", and the run " + needs;
  return missing_frames(file.times(), checkpoint, header.frame_time);
}

[[noreturn]] void refuse(const std::string& file, const TrajectoryCheckpoint& checkpoint, const std::string& why) {
  const std::string frame = std::to_string(checkpoint.frame);
  throw InputError("'" + file + "' cannot be continued from the saved state of frame " + frame + " (" + why +
                   "). Name the trajectory of the run that was saved, or an output that is not there yet: it then "
                   "begins with frame " +
                   frame);
}

}  // namespace

std::unique_ptr<InterruptedTrajectory> find_interrupted(const std::string& path, const Trajectory& header,
                                                        const TrajectoryWriteOptions& options,
                                                        const TrajectoryCheckpoint& checkpoint) {
  std::string refused, why;
  for (const std::string& file : {path + ".part", path}) {
    std::error_code code;
    if (!fs::is_regular_file(file, code) || fs::file_size(file, code) == 0) continue;
    auto hold = FileLock::attempt(file, LockKind::shared);
    if (!hold)
      throw IoError("'" + file +
                    "' is still being written by another run. Choose another output, or wait until it ends");
    std::string problem;
    try {
      auto found = std::make_unique<InterruptedTrajectory>(
          InterruptedTrajectory{file, std::move(*hold), UnfinishedTrajectory(file)});
      problem = difference(found->frames, header, options, checkpoint);
      if (problem.empty()) return found;
    } catch (const hdf5::Failure& failure) {
      problem = failure.what();
    }
    if (!refused.empty()) continue;
    refused = file;
    why = problem;
  }
  if (!refused.empty()) refuse(refused, checkpoint, why);
  return nullptr;
}

void copy_kept_frames(const InterruptedTrajectory& found, const TrajectoryCheckpoint& checkpoint, double frame_time,
                      const std::function<void(const ParticleFrame&)>& keep) {
  const std::vector<double> times = found.frames.times();
  const int64_t begin = times.empty() ? 0 : number_of(times.front(), frame_time), recent = first_recent(checkpoint);
  const auto keep_frame = [&](ParticleFrame frame, int64_t number) {
    if (number == begin && frame.velocity.empty()) frame.velocity = found.frames.initial_velocity();
    keep(frame);
  };
  int64_t next = begin;
  for (hsize_t row = 0; row < times.size() && next <= checkpoint.frame; ++row, ++next) {
    const auto frame = found.frames.read(row);
    if (!frame && next >= recent) break;  // the checkpoint has it
    if (!frame) refuse(found.file, checkpoint, "its frame " + std::to_string(next) + " is damaged");
    if (next >= recent) {
      const ParticleFrame& known = checkpoint.recent[static_cast<std::size_t>(next - recent)];
      if (frame->time != known.time || !(frame->position == known.position))
        refuse(found.file, checkpoint, "its frame " + std::to_string(next) + " is not that of the run");
    }
    keep_frame(*frame, next);
  }
  for (; next <= checkpoint.frame; ++next) keep_frame(checkpoint.recent[static_cast<std::size_t>(next - recent)], next);
}

}  // namespace graupel::io
