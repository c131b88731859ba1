// The tools in Python that verbs become: tools/convert.py.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace graupel::experiments {

/// Replaces this process by python3 running the tool `name` with these arguments, which no shell sees; GRAUPEL_PROGRAM
/// tells it this program. The tool is looked for in GRAUPEL_TOOLS where that is set; else in tools/ beside the program,
/// in ../share/graupel/tools and in the sources. Throws ConfigError where the tool or python3 is not there.
[[noreturn]] void become_python_tool(const std::string& name, const std::vector<std::string>& arguments);

/// The file of the tool, looked for in the same places; nothing where it is not there.
std::optional<std::string> find_python_tool(const std::string& name);

}  // namespace graupel::experiments
