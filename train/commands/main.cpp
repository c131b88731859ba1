// graupel-train: trains and evaluates the learned simulators. Parses the command line, calls train/, prints.
#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "core/parallel/instruction_set.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "core/system/last_resort.h"
#include "core/system/printable.h"
#include "core/system/standard_output.h"
#include "io/config/command_json.h"
#include "train/commands/coarse_command.h"
#include "train/commands/crom_command.h"
#include "train/commands/network_command.h"
#include "train/commands/nsf_command.h"
#include "train/commands/time_command.h"
#include "train/networks/network_module.h"

namespace graupel::train {
namespace {

int run(int argc, char** argv) {
  const CommandLine program("graupel-train: trains the learned simulators of Graupel.");
  program.version(std::string("graupel-train ") + GRAUPEL_VERSION + ", libtorch " + torch_version());
  program.require_command();
  std::string command_line;
  for (int i = 0; i < argc; ++i) command_line += (i > 0 ? " " : "") + std::string(argv[i]);
  int exit_code = 0;
  add_network_commands(program, command_line, exit_code);
  add_nsf_command(program, command_line, exit_code);
  add_crom_command(program, command_line, exit_code);
  add_coarse_command(program, command_line, exit_code);
  add_time_command(program, command_line);
  if (argc == 2 && std::string_view(argv[1]) == io::describe_word) {
    fmt::print("{}", io::command_json(program.description()));
    return 0;
  }
  instruction_set();              // its error, before any work
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond the limit of its size (ulimit -f) is an error of writing
  const int usage = program.run(argc, argv, "graupel-train");
  flush_standard_output();
  return usage != 0 ? usage : exit_code;
}

}  // namespace
}  // namespace graupel::train

int main(int argc, char** argv) {
  using graupel::ExitCode;
  constexpr const char* less_memory = "Set memory_limit lower, or take fewer scenes a batch";
  graupel::open_closed_streams();
  graupel::install_last_resort("graupel-train", less_memory);
  try {
    return graupel::train::run(argc, argv);
  } catch (const graupel::Error& error) {
    std::fprintf(stderr, "graupel-train: %s\n", graupel::message_text(error.what()).c_str());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "graupel-train: out of memory. %s\n", less_memory);
  } catch (const std::system_error& error) {
    try {
      graupel::flush_standard_output();
    } catch (const graupel::Error& no_output) {  // what fmt could not print
      std::fprintf(stderr, "graupel-train: %s\n", graupel::message_text(no_output.what()).c_str());
      return static_cast<int>(no_output.code());
    }
    const bool no_thread = error.code() == std::errc::resource_unavailable_try_again;
    std::fprintf(stderr, "graupel-train: %s%s\n", error.what(),
                 no_thread ? ". The system starts no more threads. Use --threads 1, or allow more (ulimit -u)" : "");
  } catch (const std::exception& error) {
    // libtorch's own error, where it cannot have the memory of a tensor.
    const bool no_memory = std::strstr(error.what(), "not enough memory") != nullptr ||
                           std::strstr(error.what(), "can't allocate memory") != nullptr;
    std::fprintf(stderr, "graupel-train: %s%s\n", no_memory ? "out of memory. " : error.what(),
                 no_memory ? less_memory : "");
  }
  return static_cast<int>(ExitCode::failed);
}
