#include "experiments/process/program.h"

#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "core/parallel/instruction_set.h"
#include "core/system/error.h"
#include "core/system/last_resort.h"
#include "core/system/printable.h"
#include "core/system/standard_output.h"
#include "core/system/stop_signal.h"
#include "experiments/process/process.h"
#include "io/config/command_json.h"
#include "nn/bf16_gemm.h"

namespace graupel::experiments {

const char* const environment_help =
    "GRAUPEL_SIMD=baseline, avx2 or avx512 in the environment chooses the instruction set of MPM's "
    "and the networks' kernels on the CPU (default: the best there is);\nGRAUPEL_PRODUCTS=f32 keeps the matrix "
    "products of networks on the CPU in f32 where it has units for bf16, bf16-vectors on vector units where it has "
    "matrix units;\nGRAUPEL_CHECKERS=FOLDER has the programs that read HDF5 and VDB files first, since their libraries "
    "crash on damaged ones ('graupel doctor' tells where they are found); none: files are read unchecked.";

namespace {

constexpr const char* less_memory = "Use fewer particles or a coarser grid ('graupel simulate --dry-run' tells)";

/// Waiting OpenMP threads spin for a few microseconds and then sleep. libgomp's default (seconds of spinning) makes two
/// threads slower than one wherever another process wants the cores, and it reads its settings before main: so the
/// program starts itself once more with them, by its own name, which ps tells. A setting of the user's own is kept.
void limit_spinning(char** argv) {
  if (std::getenv("GOMP_SPINCOUNT") != nullptr || std::getenv("OMP_WAIT_POLICY") != nullptr) return;
  ::setenv("GOMP_SPINCOUNT", "20000", 1);
  std::error_code code;
  const std::string file = std::filesystem::read_symlink("/proc/self/exe", code);
  if (!code) ::execv(file.c_str(), argv);
  ::execv("/proc/self/exe", argv);  // where the file was replaced since; on failure the run goes on as it is
}

int run_command(int argc, char** argv, const char* name, const char* description,
                const std::function<void(const CommandLine&, int&)>& declare) {
  const CommandLine program(description);
  program.version(version_text());
  program.require_command();
  int exit_code = 0;
  declare(program, exit_code);
  if (argc == 2 && std::string_view(argv[1]) == io::describe_word) {
    std::fputs(io::command_json(program.description()).c_str(), stdout);
    flush_standard_output();
    return static_cast<int>(ExitCode::ok);
  }
  catch_stop_signals(StopPolicy::within_a_second);
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond the limit of its size (ulimit -f) is an error of writing
  instruction_set();              // its error, before any work
  nn::choose_gemm_precision();
  const int usage = program.run(argc, argv, name);
  flush_standard_output();
  return usage != 0 ? usage : exit_code;
}

}  // namespace

int run_program(int argc, char** argv, const char* name, const char* description,
                const std::function<void(const CommandLine&, int&)>& declare) {
  limit_spinning(argv);
  open_closed_streams();
  install_last_resort(name, less_memory);
  try {
    return run_command(argc, argv, name, description, declare);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: %s\n", name, message_text(error.what()).c_str());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: out of memory. %s\n", name, less_memory);
  } catch (const std::filesystem::filesystem_error& error) {
    std::fprintf(stderr, "%s: cannot use '%s' (%s). Choose another folder, or a shorter name\n", name,
                 printable(error.path1().string()).c_str(), error.code().message().c_str());
    return static_cast<int>(ExitCode::io);
  } catch (const std::system_error& error) {
    const bool no_thread = error.code() == std::errc::resource_unavailable_try_again;
    std::fprintf(stderr, "%s: %s%s\n", name, message_text(error.what()).c_str(),
                 no_thread ? ". The system starts no more threads. Use --threads 1, or allow more (ulimit -u)" : "");
  } catch (const std::exception& error) {
    const bool no_memory = std::string_view(error.what()).ends_with("malloc failed");  // NanoVDB's words
    std::fprintf(
        stderr, "%s: %s\n", name,
        no_memory ? (std::string("out of memory. ") + less_memory).c_str() : message_text(error.what()).c_str());
  }
  return static_cast<int>(ExitCode::failed);
}

}  // namespace graupel::experiments
