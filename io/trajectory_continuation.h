// Which frames of an interrupted run's trajectory are kept when the run goes on.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/file_lock.h"
#include "io/unfinished_trajectory.h"

namespace graupel::io {

/// The file that holds the frames so far. Nobody else can write it meanwhile.
struct InterruptedTrajectory {
  std::string file;
  FileLock hold;
  UnfinishedTrajectory frames;
};

/// `path`.part or else `path`, whichever is of the same run as `header` and has the datasets of `options`; nothing when
/// neither is there. Throws InputError when there are files, but not of this run.
std::unique_ptr<InterruptedTrajectory> find_interrupted(const std::string& path, const Trajectory& header,
                                                        const TrajectoryWriteOptions& options, int64_t frame);

/// Calls `keep` with all frames up to the checkpoint's: those of the file, then those of the checkpoint that it lacks.
/// Throws InputError when frames are missing, or where the file and the checkpoint differ.
void copy_kept_frames(InterruptedTrajectory& found, const TrajectoryCheckpoint& checkpoint, double frame_time,
                      const std::function<void(const ParticleFrame&)>& keep);

}  // namespace graupel::io
