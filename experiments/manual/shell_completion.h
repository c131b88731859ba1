// Scripts that complete a program's command line in a shell: commands, options, values that are enumerated, files by
// their endings.
#pragma once

#include <string>

#include "core/system/command_description.h"

namespace graupel::experiments {

/// Needs bash 4 and nothing of the package bash-completion.
std::string bash_completion(const CommandDescription& program);
/// An autoloaded function for a folder of $fpath: _NAME.
std::string zsh_completion(const CommandDescription& program);
std::string fish_completion(const CommandDescription& program);

}  // namespace graupel::experiments
