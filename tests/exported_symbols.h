// The object files of kernels for one instruction set (graupel_kernels in cmake/module.cmake) define their tables of
// functions and nothing else that a linker could take for the whole program: one weak symbol among them, and the
// program could crash on an older processor.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <regex>
#include <sstream>
#include <string>

namespace graupel {

inline std::string output_of(const std::string& command) {
  const auto close = [](FILE* pipe) { pclose(pipe); };
  const std::unique_ptr<FILE, decltype(close)> pipe(popen(command.c_str(), "r"), close);
  std::string text;
  char part[256];
  while (pipe && std::fgets(part, sizeof(part), pipe.get()) != nullptr) text += part;
  return text;
}

/// Of each of `objects`, files with commas between them: `tables` symbols, whose names are like `table`.
inline void expect_exports(const std::string& nm, const std::string& objects, const std::string& table, int tables) {
  const std::regex line_of_table(".* [DR] " + table);
  std::istringstream list(objects);
  int files = 0;
  for (std::string object; std::getline(list, object, ',');) {
    ++files;
    int symbols = 0;
    std::istringstream lines(output_of(nm + " --defined-only --extern-only -C '" + object + "'"));
    for (std::string line; std::getline(lines, line);) {
      if (line.find(" __odr_asan.") != std::string::npos) continue;  // of builds with a sanitizer
      ++symbols;
      EXPECT_TRUE(std::regex_match(line, line_of_table)) << object << " defines " << line;
    }
    EXPECT_EQ(symbols, tables) << object;
  }
  EXPECT_GE(files, 1);
}

}  // namespace graupel
