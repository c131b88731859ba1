#include "experiments/process/process.h"

#include <unistd.h>

#include <cstdio>

#include "core/system/printable.h"
#include "core/system/shell_words.h"

namespace graupel::experiments {

bool interrupted() { return stop_signal() != 0; }

void warn(const std::string& text) { std::fprintf(stderr, "graupel: warning: %s\n", printable(text).c_str()); }

std::string command_line() { return shell_line(process_words()); }

std::string version_text() { return "graupel " GRAUPEL_VERSION; }

void execute(const std::string& program, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execvp(argv[0], argv.data());
}

}  // namespace graupel::experiments
