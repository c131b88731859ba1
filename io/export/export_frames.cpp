// Names and folders of exported frames.
#include "io/export/export_frames.h"

#include <cstdio>

#include "core/system/atomic_file.h"
#include "core/system/error.h"

namespace graupel::io {

void prepare_export(const Trajectory& trajectory, const std::string& folder, const std::string& name) {
  const char* allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
  if (name.empty() || name.find_first_not_of(allowed) != std::string::npos)
    throw ConfigError("'" + name + "' cannot name exported files (allowed: letters, digits, '.', '_', '-'). " +
                      "Choose another name");
  if (trajectory.frames.empty()) throw ConfigError("the trajectory has no frames (0). Export another one");
  make_folder(folder);
}

ActiveFrame active_particles(const Trajectory& trajectory, const ParticleFrame& frame) {
  ActiveFrame out;
  out.frame.time = frame.time;
  for (std::size_t i = 0; i < frame.position.size(); ++i) {
    if (!frame.is_active(i)) continue;
    out.id.push_back(static_cast<int32_t>(i));
    out.particle_type.push_back(trajectory.particle_type[i]);
    out.frame.position.push_back(frame.position[i]);
    if (!frame.velocity.empty()) out.frame.velocity.push_back(frame.velocity[i]);
  }
  return out;
}

std::string frame_file_name(const std::string& name, std::size_t frame, const std::string& ending) {
  char number[24];
  std::snprintf(number, sizeof number, "_%04zu", frame);
  return name + number + ending;
}

}  // namespace graupel::io
