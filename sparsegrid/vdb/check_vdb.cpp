// graupel-check-vdb: has OpenVDB read all grids of a file, in a process that may end (core/system/checks/file_check.h).
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <cstdlib>
#include <fstream>
#include <mutex>

#include "core/system/checks/file_check_child.h"

namespace {

void read_file(const std::string& path) {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
  // openvdb::io::File goes on with whatever its variables hold where a file ends early; this stream throws.
  std::ifstream in(path, std::ios::binary);
  in.exceptions(std::ios::failbit | std::ios::badbit);
  try {
    const openvdb::io::Stream grids(in, /*delayLoad=*/false);
  } catch (const std::ios::failure&) {
    if (in.eof()) throw graupel::FileIsCut();
  }
}

}  // namespace

int main(int argc, char** argv) {
  setenv("OPENVDB_DISABLE_DELAYED_LOAD", "1", 1);
  // The stacks of a machine's many threads would not fit into the memory that a small file may take.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  return graupel::run_checker(argc, argv, read_file);
}
