// What a program's command line takes, as JSON: programs of Graupel tell each other by it.
#pragma once

#include <string>

#include "core/system/command_description.h"

namespace graupel::io {

/// A program whose only word is this prints command_json() of its commands and ends.
inline constexpr const char* describe_word = "--describe";

std::string command_json(const CommandDescription& command);
/// Reads what command_json() wrote, and what other programs write of the same keys: those that are missing are empty.
/// Throws ConfigError; `name` stands for the program in messages.
CommandDescription parse_command_json(const std::string& text, const std::string& name);

}  // namespace graupel::io
