#include "core/system/checks/file_check_child.h"

#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <new>

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

CheckAnswer check(const std::string& path, const CheckRequest& request, const FileWalk& walk) {
  limit_memory(request.memory);
  start_clock(request.seconds);
  CheckAnswer answer = CheckAnswer::passed;
  try {
    walk(path);
  } catch (const std::bad_alloc&) {
    answer = CheckAnswer::no_memory;
  } catch (const FileIsCut&) {
    answer = CheckAnswer::cut;
  } catch (const std::exception&) {  // refused: the reader will say so
  }
  stop_clock();
  limit(RLIMIT_AS, RLIM_INFINITY);
  return answer;
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

int answer_requests(const FileWalk& walk) {
  CheckRequest request;
  while (receive(&request, sizeof request)) {
    if (request.path_length > longest_checked_path) return 2;
    std::string path(request.path_length, '\0');
    if (!receive(path.data(), path.size())) return 2;
    const auto answer = static_cast<char>(check(path, request, walk));
    if (::send(STDIN_FILENO, &answer, 1, MSG_NOSIGNAL) != 1) return 0;
  }
  return 0;
}

}  // namespace

int run_checker(int argc, char** argv, const FileWalk& walk) {
  parent = ::getppid();
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_FSIZE, 0);
  limit(RLIMIT_NOFILE, 32);
  if (argc < 2) return answer_requests(walk);
  bool all_passed = true;
  for (int i = 1; i < argc; ++i) {
    const CheckAnswer answer = check(argv[i], {.memory = uint64_t(1) << 30, .seconds = 60, .path_length = 0}, walk);
    const bool passed = answer == CheckAnswer::passed;
    std::printf("%s: %s\n", argv[i],
                passed                       ? "read to its end"
                : answer == CheckAnswer::cut ? "ends in the middle"
                                             : "needs more than 1 GiB of memory");
    all_passed = all_passed && passed;
  }
  return all_passed ? 0 : 3;
}

}  // namespace graupel
