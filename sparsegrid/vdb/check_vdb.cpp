// graupel-check-vdb: passes files that are plainly good (sparsegrid/vdb/plain_vdb.h), and leaves all others to
// graupel-check-vdb-library, which takes this process's place.
#include <fstream>
#include <iterator>
#include <string>

#include "core/system/checks/file_check_child.h"
#include "sparsegrid/vdb/plain_vdb.h"

namespace {

void read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  std::string bytes(in ? static_cast<std::size_t>(in.tellg()) : 0, '\0');
  in.seekg(0);
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!in || !graupel::sparsegrid::is_plain_vdb(bytes)) throw graupel::FileIsUndecided();
}

}  // namespace

int main(int argc, char** argv) { return graupel::run_checker(argc, argv, read_file, "graupel-check-vdb-library"); }
