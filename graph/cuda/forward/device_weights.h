// The tensors of a weights file in the GPU's memory.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/cuda/forward/packed_hgn.h"
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
      shape_[name] = tensor.shape;
    }
    numbers_.upload(all);
  }
  const float* get(const std::string& name) const { return numbers_.data() + begin_.at(name); }
  /// Every FCN of the file.
  std::map<std::string, DeviceFcn> fcns() const {
    std::map<std::string, DeviceFcn> fcns;
    const std::string last = ".layer1.weight";
    for (const auto& [name, shape] : shape_) {
      if (!name.ends_with(last)) continue;
      const std::string fcn = name.substr(0, name.size() - last.size());
      const bool norm = begin_.contains(fcn + ".norm.weight");
      fcns[fcn] = {get(name),
                   get(fcn + ".layer1.bias"),
                   get(fcn + ".layer2.weight"),
                   get(fcn + ".layer2.bias"),
                   norm ? get(fcn + ".norm.weight") : nullptr,
                   norm ? get(fcn + ".norm.bias") : nullptr,
                   static_cast<int32_t>(shape.at(1))};
    }
    return fcns;
  }

 private:
  Buffer<float> numbers_;
  std::map<std::string, std::size_t> begin_;
  std::map<std::string, std::vector<int64_t>> shape_;
};

}  // namespace graupel::graph
