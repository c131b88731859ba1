#include "apps/common_options.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "apps/outputs.h"
#include "core/atomic_file.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/stop_signal.h"

namespace graupel::apps {

void CommonOptions::add_to(CLI::App& verb) {
  verb.add_option("--seed", seed, "Seed of all random numbers")->each([this](const std::string&) {
    seed_given = true;
  });
  verb.add_option("--device", device, "auto, cpu or cuda")->capture_default_str();
  verb.add_option("--threads", threads, "CPU threads (0: all)")->check(whole_number(0, 4096))->capture_default_str();
  verb.add_option("--json", json, "Write the result as JSON to this file (-: standard output)");
}

Device CommonOptions::apply() {
  check_output_file(json);
  set_num_threads(threads);
  return parse_device(device);
}

void CommonOptions::write_json(const nlohmann::ordered_json& result) const {
  if (!json.empty()) write_file_atomically(json, result.dump(2) + "\n");
}

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

}  // namespace graupel::apps
