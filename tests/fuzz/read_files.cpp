// graupel_read_files: has the library read files that may be damaged, as the program does, many in one process, and
// says how each ended. files_campaign.py --readers feeds it.
//   stdin: a line each, "read PATH" (.h5, .vdb) or "recover PATH" (of PATH.part)
//   stdout: a line each, "CODE SECONDS MEGABYTES MESSAGE": exit code of the program, processor time, largest memory
#include <openvdb/openvdb.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "core/system/checks/checker_process.h"
#include "core/system/checks/file_check.h"
#include "core/system/error.h"
#include "io/trajectory/recovered_file.h"
#include "io/trajectory/trajectory_file.h"
#include "sparsegrid/obstacle_set.h"
#include "sparsegrid/vdb/vdb_grids.h"

namespace {

using namespace graupel;

/// What check_file() does, but with a second of the processor: libraries that loop would take most of a campaign's
/// time.
class QuickChecks {
 public:
  QuickChecks() {
    ::setenv("GRAUPEL_CHECKERS", "none", 1);  // for the readers
  }

  void check(const std::string& path) {
    const bool is_vdb = path.ends_with(".vdb");
    const uint64_t bytes = std::filesystem::file_size(path);
    const uint64_t memory = (uint64_t(256) << 20) + (is_vdb ? 48 : 4) * bytes;
    const std::string trouble = process_[is_vdb].check(program_[is_vdb], path, {memory, /*seconds=*/1, 0});
    if (!trouble.empty()) throw InputError("'" + path + "': the library " + trouble);
  }

 private:
  const std::string program_[2] = {checker_of(FileFormat::hdf5), checker_of(FileFormat::vdb)};
  CheckerProcess process_[2];
};

/// All that inspect, export and rollout ask of a trajectory.
void read_trajectories(const std::string& path) {
  const io::TrajectoryReader reader(path);
  for (int i = 0; i < reader.count(); ++i) {
    const Trajectory header = reader.header(i);
    reader.parameters(i);
    reader.attribute(i, "recovered");
    reader.initial_velocity(i);
    reader.positions(i, 0, header.frame_count());
    reader.read(i, reader.fields(i));
    if (!reader.contact_names(i).empty()) reader.contact_forces(i);
  }
}

/// All that inspect and simulate ask of a level set, which need not be rebuilt for an obstacle at its own voxel.
void read_grids(const std::string& path) {
  const std::vector<sparsegrid::GridFacts> facts = sparsegrid::inspect_vdb(path);
  Obstacle obstacle;
  obstacle.shape = Shape::vdb;
  obstacle.file = path;
  const double voxel = facts.empty() ? 0 : facts.front().voxel;
  sparsegrid::file_level_set(obstacle, "obstacle", voxel > 0.001 && voxel < 1 ? voxel : 0.02, 2 * voxel);
}

void read(const std::string& verb, const std::string& path) {
  if (verb == "recover") {
    const std::string whole = path + ".whole";
    io::recover_part_file_to(path, whole);
    std::error_code code;
    std::filesystem::remove(whole, code);
  } else if (path.ends_with(".vdb")) {
    read_grids(path);
  } else {
    read_trajectories(path);
  }
}

double processor_seconds() {
  rusage used{};
  ::getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

/// The kernel ends the process (SIGXCPU) when it takes so much more time of the processor.
void limit_time(double seconds) {
  rlimit limit{};
  ::getrlimit(RLIMIT_CPU, &limit);
  limit.rlim_cur = static_cast<rlim_t>(std::ceil(processor_seconds() + seconds));
  ::setrlimit(RLIMIT_CPU, &limit);
}

/// From here on the process's largest memory counts anew.
void forget_largest_memory() { std::ofstream("/proc/self/clear_refs") << 5; }

double largest_megabytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::FILE* const answers = ::fdopen(::dup(STDOUT_FILENO), "w");
  ::dup2(STDERR_FILENO, STDOUT_FILENO);  // OpenVDB prints warnings
  QuickChecks checks;
  const double seconds = argc > 1 ? std::stod(argv[1]) : 60;
  for (std::string line; std::getline(std::cin, line);) {
    const std::size_t space = line.find(' ');
    int code = 0;
    std::string message;
    forget_largest_memory();
    limit_time(seconds);
    const double before = processor_seconds();
    try {
      const std::string verb = line.substr(0, space), path = line.substr(space + 1);
      checks.check(verb == "recover" ? path + ".part" : path);
      read(verb, path);
    } catch (const Error& error) {
      code = static_cast<int>(error.code());
      message = error.what();
    } catch (const std::exception& error) {
      code = 1;
      message = error.what();
    }
    for (char& c : message)
      if (static_cast<unsigned char>(c) < 32) c = ' ';
    std::fprintf(answers, "%d %.3f %.0f %s\n", code, processor_seconds() - before, largest_megabytes(),
                 message.c_str());
    std::fflush(answers);
  }
  return 0;
}
