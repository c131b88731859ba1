#include "experiments/manual/command_tree.h"

#include <cstddef>

namespace graupel::experiments {

namespace {

void add(const std::vector<std::string>& before, const CommandDescription& command, std::vector<CommandPath>& tree) {
  std::vector<std::string> words = before;
  words.push_back(command.name);
  tree.push_back({words, &command});
  for (const CommandDescription& other : command.commands) add(words, other, tree);
}

}  // namespace

std::string CommandPath::joined(const std::string& between) const {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::vector<CommandPath> command_tree(const CommandDescription& program) {
  std::vector<CommandPath> tree;
  add({}, program, tree);
  return tree;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace graupel::experiments
