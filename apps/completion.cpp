// graupel completion: the script by which a shell completes graupel's command line.
#include <memory>

#include "apps/verbs.h"
#include "core/system/atomic_file.h"
#include "experiments/manual/program_description.h"
#include "experiments/manual/shell_completion.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct CompletionOptions {
  std::string shell, output = "-";  ///< -: standard output
};

}  // namespace

void add_completion(const Command& program) {
  auto options = std::make_shared<CompletionOptions>();
  const Command verb = program.command("completion", "Print the script by which a shell completes these commands");
  verb.option("shell", options->shell, "bash, zsh or fish").check(one_of({"bash", "zsh", "fish"})).required();
  verb.option("-o,--output", options->output, "Write it to this file").names_file();
  verb.footer(
      "Installed packages have the scripts already.\n\n"
      "Examples:\n  source <(graupel completion bash)\n"
      "  graupel completion zsh > ~/.zfunc/_graupel\n"
      "  graupel completion fish > ~/.config/fish/completions/graupel.fish");
  verb.callback([program, options] {
    const CommandDescription all = whole_program(program.description());
    const std::string script = options->shell == "bash"  ? bash_completion(all)
                               : options->shell == "zsh" ? zsh_completion(all)
                                                         : fish_completion(all);
    write_file_atomically(options->output, script);
  });
}

}  // namespace graupel::apps
