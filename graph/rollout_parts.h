// What rollouts of one scene and of many share: checks of what they start from, and the frames of trajectories.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"
#include "graph/config/feature_config.h"
#include "graph/features/features.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/features/particle_schedule.h"
#include "graph/features/prescribed_positions.h"

namespace graupel::graph {

/// Throws ConfigError where the network of `file` was trained for other scenes (LearnedSimulator::rollout), with
/// obstacle normals on cells of `normal_spacing` [m].
void check_fit(const FeatureConfig& config, const Scene& scene, double normal_spacing, const std::string& file);
/// Throws InputError for fewer than `frames` frames, and for frames that are not of so many finite positions.
void check_start(const std::vector<std::vector<Vec3f>>& start, std::size_t frames, std::size_t particles);
/// Throws InputError for a schedule of other particles.
void check_schedule(const Scene& scene, const ParticleSchedule* schedule, std::size_t particles);

/// What keeps rollouts from running wholly on a GPU, for messages; "" where they do: nothing of the environment
/// changes, and all of it is known there.
std::string what_changes(const Environment& environment);
/// The same with the particles.
std::string what_changes(const Environment& environment, const PrescribedPositions& prescribed,
                         const ParticleLifecycle& lifecycle);

/// Positions at the start of what is in the run and not kinematic (`kinematic` [n], or empty).
std::vector<Vec3f> matter_at(const std::vector<Vec3f>& start, const std::vector<uint8_t>& kinematic,
                             const ParticleLifecycle& lifecycle);
/// Accelerations [m/frame^2] of what only falls.
std::vector<Vec3f> falling(const Scene& scene, const std::vector<int32_t>& particle_type);

/// Of positions [n] one frame apart. `active`: [n], or empty where all are.
ParticleFrame make_frame(double time, double frame_time, std::span<const Vec3f> before, std::span<const Vec3f> current,
                         const std::vector<uint8_t>& active = {});
Trajectory empty_trajectory(const Scene& scene, const std::vector<int32_t>& particle_type, const std::string& made_by);

}  // namespace graupel::graph
