// graupel bench: starts graupel-bench beside this program.
#include "apps/verbs.h"
#include "experiments/process/sibling_program.h"

namespace graupel::apps {

using namespace experiments;

void add_bench(const Command& program) {
  const Command verb = program.command("bench", "Measure speed, and agreement with theory");
  verb.take_words_as_they_are();
  verb.callback([verb] { become(bench_program, verb.words()); });
}

}  // namespace graupel::apps
