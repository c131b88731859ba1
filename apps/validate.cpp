// graupel validate: all that is wrong with files, at once.
#include <memory>

#include "apps/verbs.h"
#include "experiments/inspection/validate.h"

namespace graupel::apps {

using namespace experiments;

void add_validate(const Command& program) {
  auto options = std::make_shared<ValidateOptions>();
  const Command verb =
      program.command("validate", "Tell all that is wrong with scenes, recipes and other files at once");
  verb.option("files", options->files,
              "Scenes, recipes and chaos floors (.json), .h5, .safetensors, .vdb, saved states, data sets' folders")
      .names_file({".json", ".h5", ".safetensors", ".vdb", ".state"})
      .names_folder()
      .required();
  options->common.add_without_run_to(verb);
  verb.footer(
      "Examples:\n  graupel validate my_scene.json\n  graupel validate scenes/shared/*.json --json -\n"
      "Exit code 0 where all is well, else 3. Of a scene all keys are read, then the rules between keys and the files "
      "that it names;\nof data sets all splits; files of other kinds up to their first error.");
  verb.callback([options] { validate(*options); });
}

}  // namespace graupel::apps
