#include "experiments/export/force_table.h"

#include <fmt/format.h>

namespace graupel::experiments {

std::string force_csv(const ForceTable& table) {
  std::string text = "frame,time_s,name";
  for (const char* column : {"impulse_{}_N_s", "force_{}_N", "torque_{}_N_m", "reference_{}_m"})
    for (const char axis : {'x', 'y', 'z'}) text += "," + fmt::format(fmt::runtime(column), axis);
  text += "\n";
  for (const ForceTable::Row& row : table.rows)
    for (std::size_t i = 0; i < table.names.size(); ++i) {
      const ContactForce& on = row.forces.at(i);
      text += fmt::format("{},{},{}", row.frame, row.time, table.names[i]);
      for (const Vec3d& v : {on.impulse, on.force, on.torque, on.reference})
        text += fmt::format(",{},{},{}", v[0], v[1], v[2]);  // the shortest that read back as the same numbers
      text += "\n";
    }
  return text;
}

}  // namespace graupel::experiments
