#include "experiments/process/sibling_program.h"

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "core/system/error.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

namespace {

/// Status of a child at its end; a signal that this process is sent meanwhile ends the child.
int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR)
    if (interrupted()) ::kill(child, SIGTERM);
  return status;
}

namespace fs = std::filesystem;

fs::path place_of(const SiblingProgram& sibling) {
  return fs::read_symlink("/proc/self/exe").parent_path() / sibling.name;
}

}  // namespace

std::optional<std::string> find(const SiblingProgram& sibling) {
  const fs::path program = place_of(sibling);
  return fs::exists(program) ? std::optional(program.string()) : std::nullopt;
}

std::string path_of(const SiblingProgram& sibling) {
  if (const std::optional<std::string> program = find(sibling)) return *program;
  throw ConfigError("'" + place_of(sibling).string() + "' is not there " + sibling.missing);
}

void become(const SiblingProgram& sibling, const std::vector<std::string>& arguments) {
  const std::string program = path_of(sibling);
  execute(program, arguments);
  throw Error(ExitCode::failed, "cannot start '" + program + "' (" + std::strerror(errno) + ")");
}

void run_to_end(const SiblingProgram& sibling, const std::vector<std::string>& arguments) {
  const std::string program = path_of(sibling), name = sibling.name;
  const pid_t child = ::fork();
  if (child < 0) throw Error(ExitCode::failed, "cannot start '" + program + "' (" + std::strerror(errno) + ")");
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    ::dup2(STDERR_FILENO, STDOUT_FILENO);
    execute(program, arguments);
    std::fprintf(stderr, "cannot start '%s' (%s)\n", program.c_str(), std::strerror(errno));
    ::_exit(static_cast<int>(ExitCode::failed));
  }
  const int status = wait_for(child);
  stop_if_interrupted();
  if (WIFSIGNALED(status))
    throw Error(ExitCode::failed, name + " was ended by a signal (" + std::string(::strsignal(WTERMSIG(status))) +
                                      "). Where memory is short, take fewer particles");
  if (WEXITSTATUS(status) != 0)
    throw Error(static_cast<ExitCode>(WEXITSTATUS(status)),
                name + " failed (exit code " + std::to_string(WEXITSTATUS(status)) + "); its message above says why");
}

}  // namespace graupel::experiments
