// graupel-bench: speed, accuracy of reduced models, and agreement with theory.
#include "bench/commands.h"
#include "experiments/process/program.h"

namespace {

void add_commands(const graupel::CommandLine& program, int&) {
  using namespace graupel::bench;
  program.footer(std::string("'graupel bench' starts this program.\n\n"
                             "Examples:\n  graupel bench mpm --material sand --particles 1000000 --device cuda\n"
                             "  graupel bench validate\n"
                             "'graupel bench COMMAND --help' explains a command.\n") +
                 graupel::experiments::environment_help);
  add_mpm(program);
  add_graph(program);
  add_rom(program);
  add_validate(program);
  add_view(program);
  add_micro(program);
}

}  // namespace

int main(int argc, char** argv) {
  return graupel::experiments::run_program(argc, argv, "graupel-bench",
                                           "graupel-bench: measures speed, and agreement with theory.", add_commands);
}
