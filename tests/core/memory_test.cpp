// Memory that is left: the system's, and that of control groups of both versions.
#include "core/parallel/memory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "tests/gpu_only.h"

namespace graupel {
namespace {

namespace fs = std::filesystem;

/// A folder with files like the kernel's.
class Kernel {
 public:
  Kernel() {
    std::string pattern = (fs::temp_directory_path() / "graupel_memory_XXXXXX").string();
    root_ = ::mkdtemp(pattern.data());
  }
  ~Kernel() { fs::remove_all(root_); }
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;
  void file(const std::string& name, const std::string& text) const {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text;
  }
  uint64_t left() const { return available_host_bytes(root_.string()); }

 private:
  fs::path root_;
};

constexpr const char* eight_gigabytes = "MemTotal:  16000000 kB\nMemFree:  1 kB\nMemAvailable:   8000000 kB\n";

TEST(Memory, WithoutGroupsTheSystemsWordCounts) {
  const Kernel kernel;
  EXPECT_EQ(kernel.left(), std::numeric_limits<uint64_t>::max());
  kernel.file("proc/meminfo", eight_gigabytes);
  EXPECT_EQ(kernel.left(), 8000000ull * 1024);
  kernel.file("proc/self/cgroup", "0::/\n");
  kernel.file("sys/fs/cgroup/memory.max", "max\n");
  kernel.file("sys/fs/cgroup/memory.current", "123\n");
  EXPECT_EQ(kernel.left(), 8000000ull * 1024);
}

TEST(Memory, TheTightestGroupCountsAndCachesAreFree) {
  const Kernel kernel;
  kernel.file("proc/meminfo", eight_gigabytes);
  kernel.file("proc/self/cgroup", "0::/user/job\n");
  kernel.file("sys/fs/cgroup/user/memory.max", "5000000000\n");
  kernel.file("sys/fs/cgroup/user/memory.current", "2000000000\n");
  kernel.file("sys/fs/cgroup/user/memory.stat", "anon 1\nactive_file 300000000\ninactive_file 200000000\n");
  EXPECT_EQ(kernel.left(), 3500000000u);
  kernel.file("sys/fs/cgroup/user/job/memory.max", "1000000\n");
  kernel.file("sys/fs/cgroup/user/job/memory.current", "400000\n");
  EXPECT_EQ(kernel.left(), 600000u);
  kernel.file("sys/fs/cgroup/user/job/memory.current", "2000000\n");
  EXPECT_EQ(kernel.left(), 0u);
}

TEST(Memory, GroupsOfTheFirstVersionCountToo) {
  const Kernel kernel;
  kernel.file("proc/meminfo", eight_gigabytes);
  kernel.file("proc/self/cgroup", "7:cpu:/x\n5:memory:/job\n");
  kernel.file("sys/fs/cgroup/memory/job/memory.limit_in_bytes", "1000000\n");
  kernel.file("sys/fs/cgroup/memory/job/memory.usage_in_bytes", "100000\n");
  EXPECT_EQ(kernel.left(), 900000u);
}

TEST(Memory, ThisMachineHasSome) { EXPECT_GT(available_bytes(Device::cpu), 1u << 20); }

TEST(Memory, AGpuHasSome) {
  GRAUPEL_NEEDS_GPU();
  EXPECT_GT(available_bytes(Device::cuda), 1u << 20);
}

}  // namespace
}  // namespace graupel
