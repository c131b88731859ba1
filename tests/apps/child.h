// A program that runs beside the test: it can be sent signals, and its standard output is kept apart from its errors.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <thread>

#include "tests/apps/program.h"

namespace graupel::test {

inline std::string text_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class Child {
 public:
  /// build/graupel with these words of a shell line, in the repository's root; its streams go to files in `folder`.
  Child(const Folder& folder, const std::string& arguments) : folder_(folder) {
    const std::string line = "exec '" GRAUPEL_BINARY_DIR "/graupel' " + arguments;
    process_ = ::fork();
    if (process_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
      ::dup2(::open(file(stream).c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), stream);
    if (::chdir(GRAUPEL_SOURCE_DIR) == 0) ::execl("/bin/sh", "sh", "-c", line.c_str(), nullptr);
    ::_exit(127);
  }
  ~Child() {
    if (!ended_) ::kill(process_, SIGKILL), ::waitpid(process_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void send(int signal) const { ::kill(process_, signal); }
  pid_t process() const { return process_; }
  /// Whether it has ended by itself within that time.
  bool ends_within(double seconds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    do {
      int status = 0;
      if (!ended_ && ::waitpid(process_, &status, WNOHANG) == process_) {
        ended_ = true;
        exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      }
      if (ended_) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    } while (std::chrono::steady_clock::now() < end);
    return false;
  }
  int exit_code() const { return exit_code_; }
  std::string output() const { return text_of(file(STDOUT_FILENO)); }
  std::string errors() const { return text_of(file(STDERR_FILENO)); }

 private:
  std::string file(int stream) const { return folder_.file(stream == STDOUT_FILENO ? "child.out" : "child.err"); }

  const Folder& folder_;
  pid_t process_ = 0;
  bool ended_ = false;
  int exit_code_ = -1;
};

}  // namespace graupel::test
