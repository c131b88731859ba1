// Words of command lines, as a shell reads them.
#pragma once

#include <string>
#include <vector>

namespace graupel {

/// The word as a POSIX shell reads it back, whatever its bytes: in single quotes unless it is plain.
std::string shell_word(const std::string& word);
/// Words joined by blanks.
std::string shell_line(const std::vector<std::string>& words);
/// argv of this process.
std::vector<std::string> process_words();
/// `words` without an option of one value, each time that it is there: --name VALUE or --name=VALUE.
std::vector<std::string> without_option(const std::vector<std::string>& words, const std::string& name);

}  // namespace graupel
