// The parent's side of a process that checks files: started once, asked for one file after the other.
#pragma once

#include <sys/types.h>

#include <string>

#include "core/system/checks/file_check_child.h"

namespace graupel {

class CheckerProcess {
 public:
  /// Has `program` walk through a file. Returns what happened to it, for a message ("crashed on it (..)"), or "" when
  /// it passed. A process that ends is started again for the next file. Throws Error when it cannot be started, and
  /// StoppedError after Ctrl-C or SIGTERM.
  std::string check(const std::string& program, const std::string& path, CheckRequest request);

 private:
  struct Outcome {
    std::string trouble;
    bool crashed = false;
  };

  void start(const std::string& program);
  bool is_mine() const;
  Outcome ask(const std::string& path, const CheckRequest& request);
  bool send_all(const void* bytes, std::size_t size);
  Outcome end(bool by_force);

  pid_t child_ = -1, owner_ = -1;  ///< a fork of the owner has another child
  int socket_ = -1;
};

}  // namespace graupel
