#include "core/system/checks/checker_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>

#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "core/system/stopwatch.h"

namespace graupel {

namespace {

constexpr int wait_ms = 20;             ///< between two looks for a signal
constexpr double wall_per_second = 60;  ///< a process may wait for a slow disk and for others; loops end by themselves

/// Attributes and actions of posix_spawn: a group of its own, so that Ctrl-C of a terminal does not reach it, no
/// signal blocked or ignored, its socket as standard input, no other file.
class SpawnSettings {
 public:
  explicit SpawnSettings(int socket) {
    ::posix_spawnattr_init(&attributes);
    ::posix_spawn_file_actions_init(&actions);
    sigset_t all, none;
    sigfillset(&all);
    sigemptyset(&none);
    ::posix_spawnattr_setsigdefault(&attributes, &all);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    ::posix_spawn_file_actions_adddup2(&actions, socket, STDIN_FILENO);
    ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  }
  ~SpawnSettings() {
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;

  posix_spawnattr_t attributes;
  posix_spawn_file_actions_t actions;
};

[[noreturn]] void cannot_start(const std::string& program, int error) {
  throw Error(ExitCode::failed, "cannot start '" + program + "', which checks files before they are read (" +
                                    std::strerror(error) + "). Allow more processes or memory");
}

}  // namespace

/// The child knows where libraries are, and nothing else of the environment.
void CheckerProcess::start(const std::string& program) {
  if (socket_ >= 0) ::close(socket_);  // that of the process this one was forked from
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) cannot_start(program, errno);
  std::string libraries = "LD_LIBRARY_PATH=", name = program;
  if (const char* const path = std::getenv("LD_LIBRARY_PATH")) libraries += path;
  char* arguments[] = {name.data(), nullptr};
  char* environment[] = {libraries.size() > std::strlen("LD_LIBRARY_PATH=") ? libraries.data() : nullptr, nullptr};
  const SpawnSettings settings(ends[1]);
  const int error =
      ::posix_spawn(&child_, name.c_str(), &settings.actions, &settings.attributes, arguments, environment);
  ::close(ends[1]);
  if (error != 0) {
    ::close(ends[0]);
    child_ = -1;
    cannot_start(program, error);
  }
  socket_ = ends[0];
  owner_ = ::getpid();
}

bool CheckerProcess::is_mine() const { return child_ > 0 && owner_ == ::getpid(); }

/// Ends the child and says how it ended.
CheckerProcess::Outcome CheckerProcess::end(bool by_force) {
  if (by_force) ::kill(child_, SIGKILL);
  ::close(socket_);
  int status = 0;
  while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  child_ = socket_ = -1;
  if (WIFSIGNALED(status))
    return {.trouble = "crashed on it: " + std::string(::strsignal(WTERMSIG(status))), .crashed = true};
  if (WEXITSTATUS(status) == check_out_of_time) return {.trouble = "does not come to an end with it"};
  return {.trouble = "ended the process that tried it, with status " + std::to_string(WEXITSTATUS(status)),
          .crashed = true};
}

bool CheckerProcess::send_all(const void* bytes, std::size_t size) {
  for (auto* at = static_cast<const char*>(bytes); size > 0;) {
    const ssize_t sent = ::send(socket_, at, size, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    at += sent;
    size -= static_cast<std::size_t>(sent);
  }
  return true;
}

CheckerProcess::Outcome CheckerProcess::ask(const std::string& path, const CheckRequest& request) {
  const int signal_before = stop_signal();
  if (!send_all(&request, sizeof request) || !send_all(path.data(), path.size())) return end(/*by_force=*/false);
  const Stopwatch watch;
  while (true) {
    pollfd answered = {socket_, POLLIN, 0};
    if (::poll(&answered, 1, wait_ms) > 0) break;
    if (const int signal = stop_signal(); signal != signal_before && (signal == SIGINT || signal == SIGTERM)) {
      end(/*by_force=*/true);
      throw_interrupted(" while '" + path + "' was checked");
    }
    if (watch.seconds() > wall_per_second * request.seconds) {
      end(/*by_force=*/true);
      return {.trouble = "did not answer in " + std::to_string(static_cast<int>(watch.seconds())) + " s"};
    }
  }
  char answer = 0;
  ssize_t got = 0;
  while ((got = ::recv(socket_, &answer, 1, 0)) < 0 && errno == EINTR) {
  }
  if (got != 1) return end(/*by_force=*/false);
  if (CheckAnswer(answer) == CheckAnswer::passed) return {};
  if (CheckAnswer(answer) == CheckAnswer::cut) return {.trouble = "finds its end in the middle of a grid"};
  if (CheckAnswer(answer) == CheckAnswer::overflow) return {.trouble = "writes or reads beyond its memory with it"};
  end(/*by_force=*/true);  // what it holds now counts no more
  return {.trouble = "wants more than " + std::to_string(request.memory >> 20) + " MiB of memory for it"};
}

std::string CheckerProcess::check(const std::string& program, const std::string& path, CheckRequest request) {
  request.path_length = static_cast<uint32_t>(path.size());
  if (path.size() > longest_checked_path) return "is not asked to read a path of that length";
  const bool is_used = is_mine();
  if (!is_used) start(program);
  Outcome outcome = ask(path, request);
  if (outcome.crashed && is_used) {  // perhaps of an earlier file
    start(program);
    outcome = ask(path, request);
  }
  return outcome.trouble;
}

}  // namespace graupel
