// graupel train: starts graupel-train beside this program, the only one linked with libtorch.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

#include "apps/verbs.h"
#include "core/error.h"

namespace graupel::apps {

namespace {

[[noreturn]] void start_training(const std::vector<std::string>& arguments) {
  const auto program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "graupel-train";
  if (!std::filesystem::exists(program))
    throw ConfigError("'" + program.string() +
                      "' is not there (this build has no training). Install libtorch-dev and run ./run build");
  std::vector<char*> argv;
  std::string name = program;
  argv.push_back(name.data());
  std::vector<std::string> copies = arguments;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execv(name.c_str(), argv.data());
  throw Error(ExitCode::failed, "cannot start '" + name + "' (" + std::strerror(errno) + ")");
}

}  // namespace

void add_train(CLI::App& app) {
  CLI::App* verb =
      app.add_subcommand("train", "Train a model on a data set (hgn, gns or nsf: graupel train hgn --help)");
  verb->prefix_command();
  verb->set_help_flag();
  verb->footer("Examples:\n  graupel train hgn --data data/hgn --out runs/hgn\n  graupel train hgn --resume runs/hgn");
  verb->callback([verb] { start_training(verb->remaining()); });
}

}  // namespace graupel::apps
