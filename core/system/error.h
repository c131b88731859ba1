// Errors that reach the user, by exit code. Libraries throw; only the programs print and exit.
// Text: "<problem> (<why, value, allowed range>). <remedy>".
#pragma once

#include <stdexcept>
#include <string>

namespace graupel {

/// Exit codes of the program.
enum class ExitCode { ok = 0, failed = 1, usage = 2, bad_input = 3, diverged = 4, io = 5, interrupted = 130 };

class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

/// A flag, scene key or recipe that asks for something impossible (exit 2).
struct ConfigError : Error {
  explicit ConfigError(const std::string& message) : Error(ExitCode::usage, message) {}
};
/// A file that is missing, damaged or of another kind (exit 3).
struct InputError : Error {
  explicit InputError(const std::string& message) : Error(ExitCode::bad_input, message) {}
};
/// A simulation or rollout that blew up (exit 4).
struct DivergedError : Error {
  explicit DivergedError(const std::string& message) : Error(ExitCode::diverged, message) {}
};
/// Writing failed: disk full, folder not writable (exit 5).
struct IoError : Error {
  explicit IoError(const std::string& message) : Error(ExitCode::io, message) {}
};

}  // namespace graupel

/// Check of a programmer's contract, in every build type: throws std::logic_error with file and line.
#define GRAUPEL_ASSERT(condition)                                                                                     \
  do {                                                                                                                \
    if (!(condition)) throw std::logic_error(std::string(__FILE__ ":") + std::to_string(__LINE__) + ": " #condition); \
  } while (false)
