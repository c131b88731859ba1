#include "experiments/process/process.h"

#include <unistd.h>

#include <csignal>

#include "core/system/error.h"
#include "core/system/shell_words.h"
#include "core/system/stop_signal.h"

namespace graupel::experiments {

bool interrupted() { return stop_signal() != 0; }

void stop_if_interrupted(const std::string& what_now) {
  if (!interrupted()) return;
  const bool by_batch_system = stop_signal() == SIGUSR1;
  throw Error(by_batch_system ? ExitCode{start_again_exit_code} : ExitCode::interrupted, "interrupted" + what_now);
}

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
