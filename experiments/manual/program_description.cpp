#include "experiments/manual/program_description.h"

#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "core/system/error.h"
#include "core/system/shell_words.h"
#include "experiments/process/python_tool.h"
#include "experiments/process/sibling_program.h"
#include "io/config/command_json.h"

namespace graupel::experiments {

namespace {

/// What a shell line prints to standard output; nothing where it fails.
std::optional<std::string> output_of(const std::string& line) {
  std::FILE* pipe = ::popen((line + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return std::nullopt;
  std::string output;
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) output.append(buffer.data(), n);
  if (::pclose(pipe) != 0) return std::nullopt;
  return output;
}

/// Options and commands of the program that a verb starts. The verb's own text says what it is for.
void add_from(const std::vector<std::string>& words, CommandDescription& verb) {
  std::vector<std::string> line = words;
  line.push_back(io::describe_word);
  const std::optional<std::string> text = output_of(shell_line(line));
  if (!text) return;
  CommandDescription other = io::parse_command_json(*text, words.back());
  verb.options = std::move(other.options);
  verb.commands = std::move(other.commands);
  if (verb.footer.empty()) verb.footer = std::move(other.footer);
}

void add_from(const SiblingProgram& sibling, CommandDescription& verb) {
  if (const std::optional<std::string> path = find(sibling)) add_from({*path}, verb);
}

}  // namespace

CommandDescription whole_program(CommandDescription program) {
  program.name = "graupel";
  for (CommandDescription& verb : program.commands) {
    if (verb.name == "train") add_from(training_program, verb);
    if (verb.name == "bench") add_from(bench_program, verb);
    if (verb.name == "convert")
      if (const std::optional<std::string> tool = find_python_tool("convert.py")) add_from({"python3", *tool}, verb);
  }
  return program;
}

}  // namespace graupel::experiments
