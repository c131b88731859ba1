// The tensors of a weights file in the GPU's memory.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/parallel/buffer.h"
#include "nn/weights.h"

namespace graupel::graph {

/// The weights in the GPU's memory, tensor after tensor.
class DeviceWeights {
 public:
  explicit DeviceWeights(const nn::Weights& weights) : numbers_(Device::cuda, 0) {
    std::vector<float> all;
    for (const auto& [name, tensor] : weights.tensors) {
      all.resize((all.size() + 31) / 32 * 32);
      begin_[name] = all.size();
      const std::vector<float> values = tensor.as_float();
      all.insert(all.end(), values.begin(), values.end());
    }
    numbers_.upload(all);
  }
  const float* operator()(const std::string& name) const { return numbers_.data() + begin_.at(name); }

 private:
  Buffer<float> numbers_;
  std::map<std::string, std::size_t> begin_;
};

}  // namespace graupel::graph
