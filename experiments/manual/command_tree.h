// A program's commands in a list, each with the words that lead to it.
#pragma once

#include <string>
#include <vector>

#include "core/system/command_description.h"

namespace graupel::experiments {

struct CommandPath {
  std::vector<std::string> words;  ///< graupel, train, hgn
  const CommandDescription* command = nullptr;

  /// The words with `between` between them.
  std::string joined(const std::string& between) const;
};

/// The program itself first, then each command before its own. `program` must outlive the list.
std::vector<CommandPath> command_tree(const CommandDescription& program);

/// Text with every occurrence of `from` replaced by `to`.
std::string replaced(std::string text, const std::string& from, const std::string& to);

}  // namespace graupel::experiments
