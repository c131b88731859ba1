#include "core/system/unfinished_file.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <climits>
#include <filesystem>
#include <utility>

namespace graupel {

namespace {

/// Names have places of their own, since a signal handler may read them at any time.
struct Slot {
  std::atomic<bool> taken = false, named = false;
  std::array<char, PATH_MAX> path;
};
std::array<Slot, 64> slots;  // zero pages until they are used

/// -1 where no slot is free or the name is too long.
int register_path(const std::string& path) {
  std::error_code code;
  const std::string whole = std::filesystem::absolute(path, code).string();
  if (code || whole.size() >= PATH_MAX) return -1;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    Slot& slot = slots[i];
    if (slot.taken.exchange(true)) continue;
    std::copy_n(whole.c_str(), whole.size() + 1, slot.path.data());
    slot.named = true;
    return static_cast<int>(i);
  }
  return -1;
}

}  // namespace

UnfinishedFile::UnfinishedFile(std::string path) : path_(std::move(path)), slot_(register_path(path_)) {}

UnfinishedFile::~UnfinishedFile() {
  if (path_.empty()) return;
  ::unlink(path_.c_str());
  keep();
}

void UnfinishedFile::keep() {
  path_.clear();
  if (slot_ < 0) return;
  Slot& slot = slots[static_cast<std::size_t>(std::exchange(slot_, -1))];
  slot.named = false;
  slot.taken = false;
}

void remove_unfinished_files() {
  for (const Slot& slot : slots)
    if (slot.named) ::unlink(slot.path.data());
}

}  // namespace graupel
