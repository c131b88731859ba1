#include "io/trajectory_continuation.h"

#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "io/json_node.h"

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
  } catch (const ConfigError&) {
    return scene_json;
  }
}

std::string contents_text(const TrajectoryWriteOptions& options) {
  std::string text = options.velocity ? "position, velocity" : "position";
  if (options.active) text += ", active";
  if (!options.fields.empty()) text += ", " + options.fields.names();
  return text;
}

/// Why a file does not continue with `header`; "" when it does.
std::string difference(const UnfinishedTrajectory& file, const Trajectory& header,
                       const TrajectoryWriteOptions& options) {
  const Trajectory there = file.header();
  if (there.particle_type != header.particle_type) return "it has other particles";
  if (there.seed != header.seed) return "it has another seed";
  if (there.frame_time != header.frame_time || physics_of(there.scene_json) != physics_of(header.scene_json))
    return "it is of another scene";
  const std::string has = contents_text(file.contents()), needs = contents_text(options);
  if (has != needs) return "it stores " + has + ", and the run " + needs;
  return "";
}

std::string range_text(int64_t first, int64_t last) {
  return first == last ? "frame " + std::to_string(first)
                       : "frames " + std::to_string(first) + "-" + std::to_string(last);
}

bool same_values(const ParticleFrame& a, const ParticleFrame& b) {
  return a.time == b.time && a.position == b.position;
}

}  // namespace

std::unique_ptr<InterruptedTrajectory> find_interrupted(const std::string& path, const Trajectory& header,
                                                        const TrajectoryWriteOptions& options, int64_t frame) {
  std::string problem;
  for (const std::string& file : {path + ".part", path}) {
    std::error_code code;
    if (!fs::is_regular_file(file, code) || fs::file_size(file, code) == 0) continue;
    auto hold = FileLock::attempt(file, LockKind::shared);
    if (!hold)
      throw IoError("'" + file +
                    "' is still being written by another run. Choose another output, or wait until it ends");
    std::string found;
    try {
      auto trajectory = std::make_unique<InterruptedTrajectory>(
          InterruptedTrajectory{file, std::move(*hold), UnfinishedTrajectory(file)});
      found = difference(trajectory->frames, header, options);
      if (found.empty()) return trajectory;
    } catch (const hdf5::Failure& failure) {
      found = failure.what();
    }
    if (problem.empty()) problem = "'" + file + "' cannot be continued from the saved state (" + found + ")";
  }
  if (!problem.empty())
    throw InputError(problem +
                     ". Name the trajectory of the run that was saved, or an output that is not there yet: it "
                     "then begins with frame " +
                     std::to_string(frame));
  return nullptr;
}

void copy_kept_frames(InterruptedTrajectory& found, const TrajectoryCheckpoint& checkpoint, double frame_time,
                      const std::function<void(const ParticleFrame&)>& keep) {
  const auto number_of = [&](const ParticleFrame& frame) {
    return static_cast<int64_t>(std::llround(frame.time / frame_time));
  };
  const auto recent_count = static_cast<int64_t>(checkpoint.recent.size());
  const int64_t first_recent = checkpoint.frame + 1 - recent_count;
  const auto recent = [&](int64_t number) -> const ParticleFrame& {
    return checkpoint.recent[static_cast<std::size_t>(number - first_recent)];
  };
  const auto refuse = [&](const std::string& why) {
    throw InputError("'" + found.file + "' cannot be continued from the saved state of frame " +
                     std::to_string(checkpoint.frame) + " (" + why +
                     "). Name the trajectory of the run that was saved, or an output that is not there yet");
  };
  int64_t next = 0;
  for (hsize_t row = 0; row < found.frames.row_count(); ++row) {
    const auto frame = found.frames.read(row);
    if (!frame) break;
    const int64_t number = number_of(*frame);
    if (row == 0) next = number;
    if (number != next || number > checkpoint.frame) break;
    if (number >= first_recent && !same_values(*frame, recent(number)))
      refuse("its frame " + std::to_string(number) + " is not that of the run");
    keep(*frame);
    ++next;
  }
  if (next > checkpoint.frame + 1) refuse("it begins with frame " + std::to_string(next));
  if (next < first_recent) refuse("it lacks " + range_text(next, first_recent - 1));
  for (; next <= checkpoint.frame; ++next) keep(recent(next));
}

}  // namespace graupel::io
