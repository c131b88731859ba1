// Writes trajectories in the formats other programs read. Particles that are not in the run in a frame are left out.
#pragma once

#include <string>

#include "core/scene/trajectory.h"

namespace graupel::io {

/// ParaView: one binary .vtp a frame and a .pvd with the times.
void export_vtp(const Trajectory& trajectory, const std::string& folder, const std::string& name);
/// Binary little-endian .ply a frame: x y z vx vy vz type.
void export_ply(const Trajectory& trajectory, const std::string& folder, const std::string& name);
/// OpenVDB points a frame (Houdini, Arnold): attributes P, v, id, type. In io/export/export_vdb.cpp.
void export_vdb_points(const Trajectory& trajectory, const std::string& folder, const std::string& name);

}  // namespace graupel::io
