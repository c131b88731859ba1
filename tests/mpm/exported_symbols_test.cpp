// The object files of the kernels for one instruction set define their tables of functions and nothing else that a
// linker could take for the whole program: one weak symbol among them, and the program could crash on an older
// processor.
#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace graupel::mpm {
namespace {

std::string output_of(const std::string& command) {
  const auto close = [](FILE* pipe) { pclose(pipe); };
  const std::unique_ptr<FILE, decltype(close)> pipe(popen(command.c_str(), "r"), close);
  std::string text;
  char part[256];
  while (pipe && std::fgets(part, sizeof(part), pipe.get()) != nullptr) text += part;
  return text;
}

TEST(ExportedSymbols, KernelsExportTheirTwoTablesAlone) {
  const std::regex table(".* [DR] graupel::mpm::[a-z0-9]+::kernels_f(32|64)");
  std::istringstream objects(GRAUPEL_KERNEL_OBJECTS);
  int files = 0;
  for (std::string object; std::getline(objects, object, ',');) {
    ++files;
    int symbols = 0;
    std::istringstream lines(output_of(GRAUPEL_NM " --defined-only --extern-only -C '" + object + "'"));
    for (std::string line; std::getline(lines, line);) {
      if (line.find(" __odr_asan.") != std::string::npos) continue;  // of builds with a sanitizer
      ++symbols;
      EXPECT_TRUE(std::regex_match(line, table)) << object << " defines " << line;
    }
    EXPECT_EQ(symbols, 2) << object;
  }
  EXPECT_GE(files, 1);
}

}  // namespace
}  // namespace graupel::mpm
