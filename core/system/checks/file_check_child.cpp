#include "core/system/checks/file_check_child.h"

#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <new>
#include <optional>
#include <vector>

namespace graupel {

namespace {

constexpr int tick_ms = 100;  ///< of processor time

volatile std::sig_atomic_t ticks_left = 0;
pid_t parent = 0;

/// Every tick of processor time: ends a walk that takes too long, or whose parent is gone.
extern "C" void count_tick(int) {
  if (::getppid() != parent) ::_exit(check_parent_is_gone);
  const int left = ticks_left;
  ticks_left = left - 1;
  if (left <= 0) ::_exit(check_out_of_time);
}

void start_clock(uint32_t seconds) {
  ticks_left = static_cast<int>(seconds * 1000 / tick_ms);
  struct sigaction action {};
  action.sa_handler = count_tick;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGPROF, &action, nullptr);
  const timeval tick = {0, tick_ms * 1000};
  const itimerval timer = {tick, tick};
  ::setitimer(ITIMER_PROF, &timer, nullptr);
}

void stop_clock() {
  const itimerval none{};
  ::setitimer(ITIMER_PROF, &none, nullptr);
}

void limit(__rlimit_resource_t resource, rlim_t value) {
  rlimit now{};
  ::getrlimit(resource, &now);
  now.rlim_cur = now.rlim_max == RLIM_INFINITY ? value : std::min<rlim_t>(value, now.rlim_max);
  ::setrlimit(resource, &now);
}

/// The process may take so many bytes more than it has.
void limit_memory(uint64_t bytes) {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  limit(RLIMIT_AS, pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE)) + bytes);
}

/// No answer: undecided.
std::optional<CheckAnswer> check(const std::string& path, const CheckRequest& request, const FileWalk& walk) {
  limit_memory(request.memory);
  start_clock(request.seconds);
  std::optional<CheckAnswer> answer = CheckAnswer::passed;
  try {
    walk(path);
  } catch (const std::bad_alloc&) {
    answer = CheckAnswer::no_memory;
  } catch (const FileIsCut&) {
    answer = CheckAnswer::cut;
  } catch (const FileOverflows&) {
    answer = CheckAnswer::overflow;
  } catch (const FileIsUndecided&) {
    answer = std::nullopt;
  } catch (const std::exception&) {  // refused: the reader will say so
  }
  stop_clock();
  limit(RLIMIT_AS, RLIM_INFINITY);
  return answer;
}

/// The program of that name in this one's folder takes the place of this process, which keeps its input and limits.
[[noreturn]] void become(const std::string& name, const std::vector<std::string>& arguments) {
  std::error_code code;
  std::string program = (std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name).string();
  std::vector<char*> words = {program.data()};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  ::execv(program.c_str(), words.data());
  ::_exit(check_is_not_whole);
}

/// False at the end of the input.
bool receive(void* to, std::size_t size) {
  for (auto* at = static_cast<char*>(to); size > 0;) {
    const ssize_t got = ::read(STDIN_FILENO, at, size);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

constexpr const char* asked = "--asked";  ///< before memory, seconds and path of a request

class Checker {
 public:
  Checker(const FileWalk& walk, const std::string& thorough) : walk_(walk), thorough_(thorough) {}

  int answer_requests() const {
    CheckRequest request;
    while (receive(&request, sizeof request)) {
      if (request.path_length > longest_checked_path) return 2;
      std::string path(request.path_length, '\0');
      if (!receive(path.data(), path.size())) return 2;
      if (!answer(path, request)) return 0;
    }
    return 0;
  }

  /// False when nobody listens.
  bool answer(const std::string& path, const CheckRequest& request) const {
    const auto found = check(path, request, walk_);
    if (!thorough_.empty() && found != CheckAnswer::passed)
      become(thorough_, {asked, std::to_string(request.memory), std::to_string(request.seconds), path});
    const auto letter = static_cast<char>(found.value_or(CheckAnswer::passed));
    return ::send(STDIN_FILENO, &letter, 1, MSG_NOSIGNAL) == 1;
  }

  int check_files(const std::vector<std::string>& files) const {
    bool all_passed = true;
    for (auto file = files.begin(); file != files.end(); ++file) {
      const auto found = check(*file, {.memory = uint64_t(1) << 30, .seconds = 60, .path_length = 0}, walk_);
      const bool passed = found.value_or(CheckAnswer::passed) == CheckAnswer::passed;
      if (!thorough_.empty() && found != CheckAnswer::passed) {
        std::fflush(stdout);
        become(thorough_, {file, files.end()});
      }
      std::printf("%s: %s\n", file->c_str(),
                  passed                           ? "read to its end"
                  : found == CheckAnswer::cut      ? "ends in the middle"
                  : found == CheckAnswer::overflow ? "goes beyond the memory of its arrays"
                                                   : "needs more than 1 GiB of memory");
      all_passed = all_passed && passed;
    }
    return all_passed ? 0 : 3;
  }

 private:
  const FileWalk& walk_;
  const std::string& thorough_;
};

}  // namespace

int run_checker(int argc, char** argv, const FileWalk& walk, const std::string& thorough) {
  parent = ::getppid();
  limit(RLIMIT_CORE, 0);
#ifndef __SANITIZE_THREAD__  // it writes a file of its own when a program begins
  limit(RLIMIT_FSIZE, 0);
#endif
  limit(RLIMIT_NOFILE, 32);
  const Checker checker(walk, thorough);
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 4 && words[0] == asked) {
    const CheckRequest request = {.memory = std::strtoull(words[1].c_str(), nullptr, 10),
                                  .seconds = static_cast<uint32_t>(std::strtoul(words[2].c_str(), nullptr, 10)),
                                  .path_length = 0};
    return checker.answer(words[3], request) ? checker.answer_requests() : 0;
  }
  return words.empty() ? checker.answer_requests() : checker.check_files(words);
}

}  // namespace graupel
