// Which frames of an interrupted run's trajectory are kept when the run goes on.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/system/file_lock.h"
#include "io/trajectory/unfinished_trajectory.h"

namespace graupel::io {

/// The file that holds the frames so far. Nobody else can write it meanwhile.
struct InterruptedTrajectory {
  std::string file;
  FileLock hold;
  UnfinishedTrajectory frames;
};

/// `path`.part or else `path`: the first that is of the same run as `header`, has the datasets of `options` and, with
/// the checkpoint, all frames; nothing when neither is there. Throws InputError when there are files, but none to
/// continue.
std::unique_ptr<InterruptedTrajectory> find_interrupted(const std::string& path, const Trajectory& header,
                                                        const TrajectoryWriteOptions& options,
                                                        const TrajectoryCheckpoint& checkpoint);

/// Calls `keep` with all frames up to the checkpoint's: those of the file, then those of the checkpoint that it lacks.
/// Throws InputError where the file is damaged or differs from the checkpoint.
void copy_kept_frames(const InterruptedTrajectory& found, const TrajectoryCheckpoint& checkpoint, double frame_time,
                      const std::function<void(const ParticleFrame&)>& keep);

}  // namespace graupel::io
