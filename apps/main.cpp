// graupel: parses the command line, runs one verb, turns errors into messages and exit codes.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>

#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/parallel/instruction_set.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "experiments/process/process.h"
#include "nn/bf16_products.h"

namespace graupel::apps {

using namespace experiments;
namespace {

/// Waiting OpenMP threads spin for a few microseconds and then sleep. libgomp's default (seconds of spinning) makes two
/// threads slower than one wherever another process wants the cores, and it reads its settings before main: so the
/// program starts itself once more with them. A setting of the user's own is kept.
void limit_spinning(char** argv) {
  if (std::getenv("GOMP_SPINCOUNT") != nullptr || std::getenv("OMP_WAIT_POLICY") != nullptr) return;
  ::setenv("GOMP_SPINCOUNT", "20000", 1);
  ::execv("/proc/self/exe", argv);  // on failure the run goes on as it is
}

int run(int argc, char** argv) {
  CLI::App app{
      "Graupel: water, sand, snow and solids among obstacles, by the material point method and by learned simulators."};
  app.set_version_flag("--version", version_text());
  app.require_subcommand(1);
  app.footer(
      "Examples:\n  graupel simulate scenes/shared/water_steps.json -o steps.h5\n"
      "  graupel compare --scenes scenes/shared/water_steps.json --models mpm,models/hgn.safetensors --report "
      "report.html\n"
      "'graupel VERB --help' explains a verb. Exit codes: 0 ok, 1 failed, 2 usage, 3 bad input, 4 diverged, 5 I/O, 130 "
      "interrupted.\nGRAUPEL_SIMD=baseline, avx2 or avx512 in the environment chooses the instruction set of MPM's "
      "and the networks' kernels on the CPU (default: the best there is);\nGRAUPEL_PRODUCTS=f32 keeps the matrix "
      "products of networks on "
      "the CPU "
      "in f32 where it has units for bf16, bf16-vectors on vector units where it has matrix units.");
  add_demo(app);
  add_compare(app);
  add_generate(app);
  add_simulate(app);
  add_train(app);
  int exit_code = 0;
  add_launch(app, exit_code);
  add_rollout(app);
  add_export(app);
  add_convert(app);
  add_inspect(app);
  add_bench(app);
  catch_stop_signals();
  try {
    instruction_set();  // its error, before any work
    nn::choose_products();
    app.parse(argc, argv);
    return exit_code;
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "graupel: %s\nRun 'graupel%s --help' for the flags.\n", parse_error_text(app, error).c_str(),
                 app.get_subcommands().empty() ? "" : (" " + app.get_subcommands().front()->get_name()).c_str());
    return static_cast<int>(ExitCode::usage);
  }
}

}  // namespace
}  // namespace graupel::apps

int main(int argc, char** argv) {
  using graupel::ExitCode;
  graupel::apps::limit_spinning(argv);
  try {
    return graupel::apps::run(argc, argv);
  } catch (const graupel::Error& error) {
    std::fprintf(stderr, "graupel: %s\n", error.what());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    std::fprintf(
        stderr, "graupel: out of memory. Use fewer particles or a coarser grid ('graupel simulate --dry-run' tells)\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "graupel: %s\n", error.what());
  }
  return static_cast<int>(ExitCode::failed);
}
