#include "core/parallel/memory.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>

#include "core/parallel/cuda_runtime.h"

namespace graupel {

namespace {

namespace fs = std::filesystem;

constexpr uint64_t unknown = std::numeric_limits<uint64_t>::max();

/// First number of a file; nothing for a missing file or the word "max".
std::optional<uint64_t> number_in(const fs::path& file) {
  std::ifstream in(file);
  uint64_t value = 0;
  if (in >> value) return value;
  return std::nullopt;
}

/// Number behind a key at the start of a line.
std::optional<uint64_t> number_after(const fs::path& file, const std::string& key) {
  std::ifstream in(file);
  std::string word;
  while (in >> word)
    if (word == key) {
      uint64_t value = 0;
      if (in >> value) return value;
    }
  return std::nullopt;
}

/// What a control group leaves, given its files.
uint64_t left_in_group(const fs::path& group, const char* limit, const char* usage) {
  const auto most = number_in(group / limit), used = number_in(group / usage);
  if (!most || !used) return unknown;
  const uint64_t caches = number_after(group / "memory.stat", "inactive_file").value_or(0) +
                          number_after(group / "memory.stat", "active_file").value_or(0);
  const uint64_t held = *used - std::min(*used, caches);
  return *most - std::min(*most, held);
}

/// The least that the group at `path` ("/a/b") and those around it leave.
uint64_t left_in_groups(const fs::path& mount, const std::string& path, const char* limit, const char* usage) {
  uint64_t left = left_in_group(mount, limit, usage);
  fs::path group = mount;
  for (const fs::path& part : fs::path(path).relative_path()) {
    group /= part;
    left = std::min(left, left_in_group(group, limit, usage));
  }
  return left;
}

}  // namespace

uint64_t available_host_bytes(const std::string& root) {
  uint64_t left = unknown;
  if (const auto kilobytes = number_after(fs::path(root) / "proc/meminfo", "MemAvailable:")) left = *kilobytes * 1024;
  std::ifstream groups(fs::path(root) / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {  // number:controllers:path, of version 2 without controllers
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1), path = line.substr(second + 1);
    const fs::path mounts = fs::path(root) / "sys/fs/cgroup";
    if (controllers.empty()) left = std::min(left, left_in_groups(mounts, path, "memory.max", "memory.current"));
    if (controllers == "memory")
      left = std::min(left, left_in_groups(mounts / "memory", path, "memory.limit_in_bytes", "memory.usage_in_bytes"));
  }
  return left;
}

uint64_t available_bytes(Device device) {
  if (device == Device::cpu) return available_host_bytes("/");
  return cuda::is_built_in() ? cuda::free_bytes() : unknown;
}

double cuda_memory_bandwidth() { return cuda::memory_bandwidth(); }
double cuda_product_peak() { return cuda::product_peak(); }

}  // namespace graupel
