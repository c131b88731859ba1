// What a command takes, as data: man pages and the completion of shells are made from it.
#pragma once

#include <string>
#include <vector>

namespace graupel {

/// An option, or a word that is given without a flag.
struct OptionDescription {
  std::vector<std::string> flags;         ///< "-o", "--output"; of a word none
  std::string word;                       ///< name of such a word; "" for options
  std::string value;                      ///< kind of its value: TEXT, INT, FLOAT ...; "" where it takes none
  std::string text, default_value;        ///< default_value as --help tells it; "" for none
  std::vector<std::string> choices;       ///< the only values that are allowed; empty: all
  std::vector<std::string> suggestions;   ///< values that may be offered beside others
  std::vector<std::string> file_endings;  ///< of the files that it names, with the dot
  bool names_file = false, names_folder = false;
  bool required = false;
  bool repeats = false;   ///< may be given several times
  bool many = false;      ///< takes all words up to the next option
  std::string delimiter;  ///< of several values in one word; "" for one value
};

struct CommandDescription {
  std::string name, text, footer;
  std::vector<OptionDescription> options;  ///< words among them, in their order
  std::vector<CommandDescription> commands;
};

}  // namespace graupel
