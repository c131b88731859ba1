// Reads a trajectory frame by frame: how its centre of mass moves. read_trajectory FILE.h5
#include <graupel/io.h>

#include <cmath>
#include <cstdio>
#include <string>

using namespace graupel;

double mean_height(const ParticleFrame& frame) {
  double sum = 0;
  for (const Vec3f& x : frame.position) sum += x[1];
  return sum / static_cast<double>(frame.position.size());
}

int main(int argc, char** argv) try {
  const std::string file = argc > 1 ? argv[1] : "jelly_block.h5";
  const io::TrajectoryReader reader(file);
  const Trajectory header = reader.header(0);
  const Scene scene = io::parse_stored_scene(header.scene_json, file, file);
  std::printf("%zu particles, %zu frames of %.4f s by %s\n", header.particle_count(), header.frame_count(),
              header.frame_time, header.made_by.c_str());
  double start = 0, largest_error = 0;
  for (std::size_t f = 0; f < header.frame_count(); ++f) {
    const ParticleFrame frame = reader.frames(0, static_cast<int64_t>(f), 1).front();
    const double height = mean_height(frame), t = frame.time;
    if (f == 0) start = height;
    if (f % 5 == 0) std::printf("t = %.2f s: %.4f m\n", t, height);
    // Free fall, before anything is touched.
    if (f < 5) largest_error = std::fmax(largest_error, std::abs(height - start - 0.5 * scene.gravity[1] * t * t));
  }
  std::printf("off free fall by at most %.1e m in the first frames\n", largest_error);
  return largest_error < 1e-3 ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return static_cast<int>(error.code());
}
