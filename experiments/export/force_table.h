// Forces on obstacles and walls as CSV.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/contact_force.h"

namespace graupel::experiments {

/// Of some frames of a trajectory.
struct ForceTable {
  struct Row {
    int64_t frame = 0;                 ///< its number in the trajectory
    double time = 0;                   ///< [s]
    std::vector<ContactForce> forces;  ///< [names]
  };
  std::vector<std::string> names;  ///< of the obstacles and walls
  std::vector<Row> rows;
};

/// A line a frame and obstacle or wall, with units in the names of the columns.
std::string force_csv(const ForceTable& table);

}  // namespace graupel::experiments
