// graupel convert of one file: weights with other numbers, or a scene with every key.
#pragma once

#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::experiments {

struct FileConversion {
  CommonOptions common;
  std::string input, output;      ///< .safetensors, else a scene
  std::string numbers;            ///< of weights: f32, f16, bf16 or i8
  std::vector<std::string> keep;  ///< of i8: what stays in 16 bits, by the beginnings of names
  std::vector<std::string> set;   ///< changes of the scene's keys
};

/// Throws ConfigError where `numbers` is missing or a number does not fit, and as the readers and writers of both.
void convert_file(FileConversion& conversion);

}  // namespace graupel::experiments
