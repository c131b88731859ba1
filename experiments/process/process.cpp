#include "experiments/process/process.h"

#include <unistd.h>

#include <fstream>
#include <iterator>

#include "core/system/error.h"
#include "core/system/stop_signal.h"

namespace graupel::experiments {

bool interrupted() { return stop_signal() != 0; }

void stop_if_interrupted(const std::string& what_now) {
  if (interrupted()) throw Error(ExitCode::interrupted, "interrupted" + what_now);
}

std::string command_line() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::string line;
  for (std::size_t start = 0; start < bytes.size();) {
    const std::string word = bytes.c_str() + start;
    start += word.size() + 1;
    const bool plain = !word.empty() && word.find_first_not_of(
                                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                            "0123456789_-+=./,:@%#") == std::string::npos;
    line += line.empty() ? "" : " ";
    if (plain) {
      line += word;
      continue;
    }
    line += "'";
    for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += "'";
  }
  return line;
}

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
