// graupel: the verbs, and what --help says of them all.
#include <sys/resource.h>
#include <unistd.h>

#include "apps/verbs.h"
#include "experiments/process/program.h"

namespace {

/// Before the libraries' own start, in which some crash where they get no memory.
void check_address_space() {
  constexpr rlim_t least = 180u << 20;
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur >= least) return;
  constexpr char text[] =
      "graupel: less than 180 MB of address space are allowed (ulimit -v). Allow more, 1 GB for small scenes\n";
  if (::write(STDERR_FILENO, text, sizeof text - 1) >= 0) ::_exit(1);
  ::_exit(1);
}
[[gnu::section(".preinit_array"), gnu::used]] void (*const first_of_all)() = check_address_space;

void add_verbs(const graupel::CommandLine& program, int& exit_code) {
  using namespace graupel::apps;
  program.footer(
      std::string(
          "Examples:\n  graupel simulate scenes/shared/water_steps.json -o steps.h5\n"
          "  graupel compare --scenes scenes/shared/water_steps.json --models mpm,models/hgn.safetensors --report "
          "report.html\n"
          "'graupel VERB --help' explains a verb.\n"
          "Exit codes: 0 ok; 1 failed; 2 wrong flags, or values in scenes and recipes that cannot be; 3 input files "
          "that are missing, damaged\nor of another kind; 4 diverged; 5 an output cannot be written; 75 stopped by "
          "SIGUSR1 (start again to go on);\n130 stopped by Ctrl-C or SIGTERM.\n") +
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
  add_man(program);
  add_completion(program);
}

}  // namespace

int main(int argc, char** argv) {
  return graupel::experiments::run_program(
      argc, argv, "graupel",
      "Graupel: water, sand, snow and solids among obstacles, by the material point method and by learned simulators.",
      add_verbs);
}
