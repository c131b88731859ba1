// A checker whose walk does what the file's name says: crash, loop, allocate, end, or pass.
#include <unistd.h>

#include <csignal>
#include <vector>

#include "core/system/checks/file_check_child.h"

namespace {

void walk(const std::string& path) {
  const auto says = [&](const char* word) { return path.find(word) != std::string::npos; };
  static std::vector<std::vector<char>> kept;
  if (says("crash")) ::raise(SIGSEGV);
  if (says("exit")) ::_exit(7);
  while (says("allocate")) kept.emplace_back(1 << 20, 'x');
  volatile long turns = 0;
  while (says("loop")) turns = turns + 1;
  while (says("sleep")) ::pause();
}

}  // namespace

int main(int argc, char** argv) { return graupel::run_checker(argc, argv, walk); }
