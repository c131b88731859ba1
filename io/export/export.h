// Writes trajectories in the formats other programs read. Particles that are not in the run in a frame are left out.
#pragma once

#include <string>
#include <vector>

#include "core/scene/contact_force.h"
#include "core/scene/trajectory.h"

namespace graupel::io {

/// ParaView: one binary .vtp a frame and a .pvd with the times.
void export_vtp(const Trajectory& trajectory, const std::string& folder, const std::string& name);
/// Binary little-endian .ply a frame: x y z vx vy vz type.
void export_ply(const Trajectory& trajectory, const std::string& folder, const std::string& name);
/// OpenVDB points a frame (Houdini, Arnold): attributes P, v, id, type. In io/export/export_vdb.cpp.
void export_vdb_points(const Trajectory& trajectory, const std::string& folder, const std::string& name);

/// The forces of a trajectory.
struct ForceTable {
  std::vector<double> times;                      ///< [frames] [s]
  std::vector<std::string> names;                 ///< of the obstacles and walls
  std::vector<std::vector<ContactForce>> forces;  ///< [frames, names]
};
/// CSV: a line a frame and obstacle or wall, with units in the names of the columns.
void export_forces(const ForceTable& table, const std::string& file);

}  // namespace graupel::io
