// graupel man: man pages of the verbs.
#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "apps/verbs.h"
#include "core/system/error.h"
#include "experiments/manual/man_page.h"
#include "experiments/manual/man_page_files.h"
#include "experiments/manual/program_description.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct ManOptions {
  std::vector<std::string> command;
  std::string folder;
};

void man(const Command& program, const ManOptions& options) {
  if (!options.folder.empty() && !options.command.empty())
    throw ConfigError("--folder writes the pages of all commands. Leave the words of one out, or --folder");
  const std::vector<ManPage> pages = program_man_pages(whole_program(program.description()));
  if (options.folder.empty())
    std::fputs(find_page(pages, options.command).text.c_str(), stdout);
  else
    write_pages(pages, options.folder);
}

}  // namespace

void add_man(const Command& program) {
  auto options = std::make_shared<ManOptions>();
  const Command verb = program.command("man", "Print the man page of a command, or write all of them");
  verb.option("command", options->command, "Words of the command: simulate, or train hgn; none: graupel itself");
  verb.option("--folder", options->folder, "Write all pages into this folder instead").names_folder();
  verb.footer(
      "Installed packages have the pages already: man graupel-simulate.\n\n"
      "Examples:\n  graupel man train hgn | man -l -\n  graupel man --folder ~/.local/share/man/man1");
  verb.callback([program, options] { man(program, *options); });
}

}  // namespace graupel::apps
