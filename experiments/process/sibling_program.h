// Programs of Graupel that lie beside this one: graupel-train, the only one linked with libtorch, and graupel-bench.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace graupel::experiments {

struct SiblingProgram {
  const char* name;
  const char* missing;  ///< why it may not be there, and the remedy
};

inline constexpr SiblingProgram training_program = {
    "graupel-train", "(this build has no training). Install libtorch-dev and run ./run build"};
inline constexpr SiblingProgram bench_program = {
    "graupel-bench",
    "(this build has no benchmarks). Run ./run build, or configure with -DGRAUPEL_BENCH=ON and build the target "
    "graupel-bench"};

/// Its path; nothing where it is not there.
std::optional<std::string> find(const SiblingProgram& sibling);
/// Its path. Throws ConfigError where it is not there.
std::string path_of(const SiblingProgram& sibling);

/// This process goes on as that program, with these arguments. Returns only by Error, where it cannot be started.
[[noreturn]] void become(const SiblingProgram& sibling, const std::vector<std::string>& arguments);

/// Runs it to its end; it prints to this program's standard error. Throws Error with its exit code unless that is 0,
/// and ExitCode::interrupted after Ctrl-C or SIGTERM, which end it too.
void run_to_end(const SiblingProgram& sibling, const std::vector<std::string>& arguments);

}  // namespace graupel::experiments
