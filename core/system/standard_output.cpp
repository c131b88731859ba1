#include "core/system/standard_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <string>

#include "core/system/error.h"

namespace graupel {

namespace {
int descriptor = STDOUT_FILENO;
}

void open_closed_streams() {
  constexpr int modes[] = {O_RDONLY, O_RDONLY, O_WRONLY};
  for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream)
    if (::fcntl(stream, F_GETFD) < 0) static_cast<void>(::open("/dev/null", modes[stream]));  // the lowest free number
}

void reserve_standard_output() {
  if (descriptor != STDOUT_FILENO) return;
  const int copy = ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  if (copy < 0 || ::dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
    throw IoError(std::string("cannot write to standard output (") + std::strerror(errno) + "). Name a file");
  descriptor = copy;
}

int standard_output() { return descriptor; }

void flush_standard_output() {
  errno = 0;
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good()) return;
  if (errno == EBADF) throw IoError("cannot write to standard output (it is closed). Open it, or print to a file");
  const std::string reason = errno != 0 ? std::strerror(errno) : "what was printed is incomplete, as on a full disk";
  throw IoError("cannot write to standard output (" + reason + "). Free space there, or print to another file");
}

}  // namespace graupel
