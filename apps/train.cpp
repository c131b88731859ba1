// graupel train: starts graupel-train beside this program, the only one linked with libtorch.
#include "apps/verbs.h"
#include "experiments/process/sibling_program.h"

namespace graupel::apps {

using namespace experiments;

void add_train(const Command& program) {
  const Command verb =
      program.command("train", "Train a model (hgn, gns, nsf, crom or coarse: graupel train hgn --help)");
  verb.take_words_as_they_are();
  verb.footer(
      "'graupel train time' measures a graph network in libtorch.\n\n"
      "Examples:\n  graupel train hgn --data data/hgn --out runs/hgn\n  graupel train hgn --resume runs/hgn");
  verb.callback([verb] { become(training_program, verb.words()); });
}

}  // namespace graupel::apps
