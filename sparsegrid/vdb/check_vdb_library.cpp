// graupel-check-vdb-library: has OpenVDB read all grids of a file that is not plain, in place of graupel-check-vdb, in
// a process that may end (core/system/checks/file_check.h). openvdb::io::File goes on with whatever its variables hold
// where a file ends early; the streams here throw.
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <cstdlib>
#include <fstream>
#include <mutex>
#include <new>

#include "core/system/checks/file_check_child.h"

namespace {

/// As the program does: where the file says that its grids begin and end, which a stream does not ask. A grid that is
/// refused does not keep the program from the next.
class GridsByPlace : public openvdb::io::Archive {
 public:
  explicit GridsByPlace(std::istream& in) {
    openvdb::SharedPtr<openvdb::io::StreamMetadata> settings(new openvdb::io::StreamMetadata);
    settings->setSeekable(true);
    openvdb::io::setStreamMetadataPtr(in, settings, /*transfer=*/false);
    readHeader(in);
    if (!inputHasGridOffsets()) return;
    setFormatVersion(in);
    setLibraryVersion(in);
    setDataCompression(in);
    openvdb::MetaMap().readMeta(in);
    for (int32_t left = readGridCount(in); left > 0; --left) {
      openvdb::io::GridDescriptor descriptor;
      const openvdb::GridBase::Ptr grid = descriptor.read(in);
      try {
        descriptor.seekToGrid(in);
        readGrid(grid, descriptor, in);
      } catch (const std::bad_alloc&) {
        throw;
      } catch (const std::ios::failure&) {
        throw;
      } catch (const std::exception&) {
      }
      descriptor.seekToEnd(in);
    }
  }
};

/// What is refused in one order the program may not come to in another.
template <typename Grids>
void read_all(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  in.exceptions(std::ios::failbit | std::ios::badbit);
  try {
    const Grids grids(in);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::ios::failure&) {
    throw graupel::FileIsCut();  // a place before the file, or a length of exabytes, is no better than its end
  } catch (const std::exception&) {
  }
}

struct GridsInOrder : openvdb::io::Stream {
  explicit GridsInOrder(std::istream& in) : Stream(in, /*delayLoad=*/false) {}
};

void read_file(const std::string& path) {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
  read_all<GridsInOrder>(path);
  read_all<GridsByPlace>(path);
}

}  // namespace

int main(int argc, char** argv) {
  setenv("OPENVDB_DISABLE_DELAYED_LOAD", "1", 1);
  // The stacks of a machine's many threads would not fit into the memory that a small file may take.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  return graupel::run_checker(argc, argv, read_file);
}
