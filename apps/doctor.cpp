// graupel doctor: devices, instruction set, libraries, and why runs are slow on this machine.
#include <memory>

#include "apps/verbs.h"
#include "experiments/inspection/doctor.h"

namespace graupel::apps {

using namespace experiments;

void add_doctor(const Command& program) {
  auto options = std::make_shared<CommonOptions>();
  const Command verb = program.command(
      "doctor", "Tell devices, instruction set and libraries, and what makes runs slow on this machine");
  options->add_without_run_to(verb);
  verb.footer("Examples:\n  graupel doctor\n  graupel doctor --threads 4 --json machine.json");
  verb.callback([options] { doctor(*options); });
}

}  // namespace graupel::apps
