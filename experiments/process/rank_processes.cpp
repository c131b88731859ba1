#include "experiments/process/rank_processes.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <utility>

#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void throw_system_error(const std::string& what) {
  throw Error(ExitCode::failed, what + " (" + std::strerror(errno) + ")");
}

/// A file descriptor that is closed with this object.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    close();
    number_ = std::exchange(other.number_, -1);
    return *this;
  }
  int number() const { return number_; }
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }

 private:
  int number_;
};

/// A port of this machine that nothing listens on.
int free_port() {
  const Descriptor listener(::socket(AF_INET, SOCK_STREAM, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  if (::bind(listener.number(), any, size) != 0 || ::getsockname(listener.number(), any, &size) != 0)
    throw_system_error("no free port was found for the ranks to meet");
  return ntohs(address.sin_port);
}

/// SIGINT, SIGTERM, SIGUSR1 and SIGCHLD as something to read, while this lives.
class BlockedSignals {
 public:
  BlockedSignals() {
    sigset_t set;
    sigemptyset(&set);
    for (const int signal : {SIGINT, SIGTERM, SIGUSR1, SIGCHLD}) sigaddset(&set, signal);
    ::sigprocmask(SIG_BLOCK, &set, &before_);
    descriptor_ = Descriptor(::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC));
    if (descriptor_.number() < 0) throw_system_error("signals cannot be received");
  }
  ~BlockedSignals() { restore(); }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;

  void restore() const { ::sigprocmask(SIG_SETMASK, &before_, nullptr); }
  int number() const { return descriptor_.number(); }
  /// The next signal that came, 0 for none.
  int next() const {
    signalfd_siginfo info{};
    return ::read(number(), &info, sizeof(info)) == sizeof(info) ? static_cast<int>(info.ssi_signo) : 0;
  }

 private:
  sigset_t before_{};
  Descriptor descriptor_;
};

/// One process, and what it prints.
struct Rank {
  pid_t process = 0;
  bool running = true;
  Descriptor output;  ///< of ranks above 0
  std::string line;   ///< read so far
};

class Supervisor {
 public:
  explicit Supervisor(const RankProcesses& ranks) : settings_(ranks) {}
  ~Supervisor() {
    for (const Rank& rank : ranks_)
      if (rank.running) ::kill(rank.process, SIGKILL);
  }
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  int run() {
    const int port = free_port();
    for (int rank = 0; rank < settings_.count; ++rank) start(rank, port);
    while (any_running()) {
      wait();
      while (const int signal = signals_.next())
        if (signal != SIGCHLD) forward(signal);
      for (std::size_t rank = 0; rank < ranks_.size(); ++rank) collect(rank);
      if (deadline_ && Clock::now() > *deadline_) send(SIGKILL);
    }
    for (std::size_t rank = 0; rank < ranks_.size(); ++rank) relay(rank);
    return failure_ ? failure_ : saved_;
  }

 private:
  void start(int rank, int port);
  [[noreturn]] void become(int rank, int port, int output, pid_t parent) const;
  void wait();
  void collect(std::size_t rank);
  void relay(std::size_t rank);
  void end_of(std::size_t rank, int status);

  bool any_running() const {
    for (const Rank& rank : ranks_)
      if (rank.running) return true;
    return false;
  }
  void send(int signal) const {
    for (const Rank& rank : ranks_)
      if (rank.running) ::kill(rank.process, signal);
  }
  void forward(int signal) {
    stopping_ = true;
    send(signal);
  }
  void print_lines(std::size_t rank, bool all) {
    std::string& text = ranks_[rank].line;
    for (std::size_t end; (end = text.find('\n')) != std::string::npos || (all && !text.empty());) {
      end = std::min(end, text.size());
      std::fprintf(stderr, "[rank %zu] %s\n", rank, text.substr(0, end).c_str());
      text.erase(0, end + 1);
    }
  }

  const RankProcesses& settings_;
  BlockedSignals signals_;
  std::vector<Rank> ranks_;
  bool stopping_ = false;  ///< a signal was forwarded: the ranks end in their own time
  int saved_ = 0;          ///< exit code of a rank that ended so
  int failure_ = 0;        ///< exit code of the rank that failed of itself
  std::optional<Clock::time_point> deadline_;
};

void Supervisor::start(int rank, int port) {
  int ends[2] = {-1, -1};
  if (rank > 0 && ::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) throw_system_error("cannot make a pipe");
  Descriptor read_end(ends[0]), write_end(ends[1]);
  if (rank > 0) ::fcntl(ends[1], F_SETFL, 0);  // the rank itself waits for room
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0) throw_system_error("cannot start rank " + std::to_string(rank));
  if (child == 0) become(rank, port, write_end.number(), parent);
  ranks_.push_back({child, true, std::move(read_end), ""});
}

/// The child's part of start().
void Supervisor::become(int rank, int port, int output, pid_t parent) const {
  // Ctrl-C in a terminal reaches the launcher alone, which forwards it once; its death ends the ranks.
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(static_cast<int>(ExitCode::failed));
  signals_.restore();
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) ::signal(signal, SIG_DFL);
  const std::string number = std::to_string(rank), count = std::to_string(settings_.count);
  ::setenv("RANK", number.c_str(), 1);
  ::setenv("LOCAL_RANK", number.c_str(), 1);
  ::setenv("WORLD_SIZE", count.c_str(), 1);
  ::setenv("LOCAL_WORLD_SIZE", count.c_str(), 1);
  ::setenv("MASTER_ADDR", "127.0.0.1", 1);
  ::setenv("MASTER_PORT", std::to_string(port).c_str(), 1);
  for (const char* name : {"TORCHELASTIC_RUN_ID", "TORCHELASTIC_USE_AGENT_STORE", "TORCHELASTIC_RESTART_COUNT"})
    ::unsetenv(name);
  const int nothing = ::open("/dev/null", O_RDONLY);
  ::dup2(nothing, STDIN_FILENO);
  if (output >= 0) {
    ::dup2(output, STDOUT_FILENO);
    ::dup2(output, STDERR_FILENO);
  }
  execute(settings_.program, settings_.arguments);
  std::fprintf(stderr, "cannot start '%s' (%s)\n", settings_.program.c_str(), std::strerror(errno));
  ::_exit(static_cast<int>(ExitCode::failed));
}

/// Until a signal comes, a rank prints or the ranks' time is over.
void Supervisor::wait() {
  std::vector<pollfd> sources = {{signals_.number(), POLLIN, 0}};
  for (const Rank& rank : ranks_)
    if (rank.output.number() >= 0) sources.push_back({rank.output.number(), POLLIN, 0});
  ::poll(sources.data(), sources.size(), deadline_ ? 100 : -1);
}

void Supervisor::collect(std::size_t rank) {
  relay(rank);
  int status = 0;
  if (!ranks_[rank].running || ::waitpid(ranks_[rank].process, &status, WNOHANG) != ranks_[rank].process) return;
  ranks_[rank].running = false;
  end_of(rank, status);
}

/// Passes on what a rank has printed.
void Supervisor::relay(std::size_t rank) {
  Descriptor& output = ranks_[rank].output;
  char text[4096];
  while (output.number() >= 0) {
    const ssize_t count = ::read(output.number(), text, sizeof(text));
    if (count > 0) {
      ranks_[rank].line.append(text, static_cast<std::size_t>(count));
      print_lines(rank, false);
    } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
      output.close();
      print_lines(rank, true);
    } else {
      return;
    }
  }
}

void Supervisor::end_of(std::size_t rank, int status) {
  const bool killed = WIFSIGNALED(status);
  const int code = killed ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  if (code == 0) return;
  if (stopping_ && (code == static_cast<int>(ExitCode::interrupted) || code == start_again_exit_code)) {
    saved_ = code;
    return;
  }
  constexpr int failed = static_cast<int>(ExitCode::failed);
  const bool first = failure_ == 0;
  // A rank that loses another one fails, often sooner than the other has ended: what is more than that is the cause.
  const bool by_launcher = killed && (WTERMSIG(status) == SIGTERM || WTERMSIG(status) == SIGKILL);
  if (!first && (failure_ != failed || code == failed || by_launcher)) return;
  failure_ = code;
  const std::string how = killed ? std::string("was ended by signal ") + ::strsignal(WTERMSIG(status))
                                 : "ended with exit code " + std::to_string(code);
  std::fprintf(stderr, "graupel launch: rank %zu %s%s\n", rank, how.c_str(),
               first && any_running() ? "; ending the other ranks" : "");
  if (!first) return;
  deadline_ = Clock::now() + std::chrono::milliseconds(static_cast<int64_t>(1000 * settings_.grace));
  if (!stopping_) send(SIGTERM);
}

}  // namespace

int run_rank_processes(const RankProcesses& ranks) { return Supervisor(ranks).run(); }

}  // namespace graupel::experiments
