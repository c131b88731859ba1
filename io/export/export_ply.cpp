// Binary little-endian PLY, one file a frame.
#include "core/system/atomic_file.h"
#include "io/export/export.h"
#include "io/export/export_frames.h"

namespace graupel::io {

namespace {

std::string ply_bytes(const ActiveFrame& active) {
  const ParticleFrame& frame = active.frame;
  const bool velocity = !frame.velocity.empty();
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(frame.position.size()) +
                    "\nproperty float x\nproperty float y\nproperty float z\n";
  if (velocity) out += "property float vx\nproperty float vy\nproperty float vz\n";
  out += "property int type\nend_header\n";
  for (std::size_t i = 0; i < frame.position.size(); ++i) {
    append_bytes(out, frame.position[i]);
    if (velocity) append_bytes(out, frame.velocity[i]);
    append_bytes(out, active.particle_type[i]);
  }
  return out;
}

}  // namespace

void export_ply(const Trajectory& trajectory, const std::string& folder, const std::string& name) {
  prepare_export(trajectory, folder, name);
  for (std::size_t k = 0; k < trajectory.frames.size(); ++k)
    write_file_atomically(folder + "/" + frame_file_name(name, k, ".ply"),
                          ply_bytes(active_particles(trajectory, trajectory.frames[k])));
}

}  // namespace graupel::io
