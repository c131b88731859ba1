// graupel-check-vdb: has OpenVDB read all grids of a file, in a process that may end (core/system/checks/file_check.h).
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <cstdlib>
#include <fstream>
#include <mutex>
#include <new>

#include "core/system/checks/file_check_child.h"

namespace {

/// From its beginning to its end. openvdb::io::File goes on with whatever its variables hold where a file ends early;
/// this stream throws.
void read_in_order(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  in.exceptions(std::ios::failbit | std::ios::badbit);
  try {
    const openvdb::io::Stream grids(in, /*delayLoad=*/false);
  } catch (const std::ios::failure&) {
    if (in.eof()) throw graupel::FileIsCut();
  }
}

/// As the program does: where the file says that its grids begin and end, which a stream does not ask. One that is
/// refused does not keep the program from the next.
void read_by_place(const std::string& path) {
  openvdb::io::File file(path);
  file.open(/*delayLoad=*/false);
  for (auto name = file.beginName(); name != file.endName(); ++name) try {
      file.readGridMetadata(*name);
      file.readGrid(*name);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception&) {
    }
}

void read_file(const std::string& path) {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
  try {
    read_in_order(path);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const graupel::FileIsCut&) {
    throw;
  } catch (const std::exception&) {  // refused: in the same order the program may not come to it
  }
  read_by_place(path);
}

}  // namespace

int main(int argc, char** argv) {
  setenv("OPENVDB_DISABLE_DELAYED_LOAD", "1", 1);
  // The stacks of a machine's many threads would not fit into the memory that a small file may take.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  return graupel::run_checker(argc, argv, read_file);
}
