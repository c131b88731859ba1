// Lines for the terminal and, once a run has its folder, for the log.txt in it.
#pragma once

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "train/networks/network_module.h"

namespace graupel::train {

class RunLog {
 public:
  void line(const std::string& text, const std::string& run) {
    if (!file_.is_open() && std::filesystem::exists(run + "/config.json")) file_.open(run + "/log.txt", std::ios::app);
    std::fprintf(stderr, "%s\n", text.c_str());
    if (file_.is_open()) file_ << text << "\n" << std::flush;
  }

 private:
  std::ofstream file_;
};

/// Device of a --device word; "auto" is the GPU only where libtorch can use it too.
inline Device device_for_torch(const std::string& word) {
  return word == "auto" && !torch_has_cuda() ? Device::cpu : parse_device(word);
}

}  // namespace graupel::train
