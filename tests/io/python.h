// Python with NumPy and h5py, where the system has them: what other programs see of our files, and files made by them.
#pragma once

#include <array>
#include <cstdio>
#include <string>

#include "tests/io/temporary_folder.h"

namespace graupel {

struct PythonOutcome {
  bool good = false;
  std::string output;  ///< standard output and error
};

inline PythonOutcome run_python(const TemporaryFolder& folder, const std::string& script,
                                const std::string& arguments = "") {
  const std::string file = folder.write("script.py", script);
  PythonOutcome outcome;
  std::FILE* pipe = ::popen(("/usr/bin/python3 " + file + " " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    outcome.output.append(buffer.data(), n);
  outcome.good = ::pclose(pipe) == 0;
  return outcome;
}

inline bool python_has(const TemporaryFolder& folder, const std::string& module) {
  return run_python(folder, "import " + module + "\n").good;
}

}  // namespace graupel
