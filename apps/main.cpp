// graupel: the verbs, and what --help says of them all.
#include "apps/verbs.h"
#include "experiments/process/program.h"

namespace {

void add_verbs(const graupel::CommandLine& program, int& exit_code) {
  using namespace graupel::apps;
  program.footer(
      std::string(
          "Examples:\n  graupel simulate scenes/shared/water_steps.json -o steps.h5\n"
          "  graupel compare --scenes scenes/shared/water_steps.json --models mpm,models/hgn.safetensors --report "
          "report.html\n"
          "'graupel VERB --help' explains a verb. Exit codes: 0 ok, 1 failed, 2 usage, 3 bad input, 4 diverged, 5 I/O, "
          "75 stopped by SIGUSR1 (start again to go on), 130 interrupted.\n") +
      graupel::experiments::environment_help);
  add_demo(program);
  add_compare(program);
  add_generate(program);
  add_simulate(program);
  add_train(program);
  add_launch(program, exit_code);
  add_rollout(program);
  add_export(program);
  add_convert(program);
  add_inspect(program);
  add_validate(program);
  add_view(program);
  add_doctor(program);
  add_bench(program);
}

}  // namespace

int main(int argc, char** argv) {
  return graupel::experiments::run_program(
      argc, argv, "graupel",
      "Graupel: water, sand, snow and solids among obstacles, by the material point method and by learned simulators.",
      add_verbs);
}
