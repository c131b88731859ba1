#include "graph/features/normalization.h"

#include <algorithm>

#include "core/system/error.h"

namespace graupel::graph {

Normalization read_normalization(const nn::Weights& weights) {
  Normalization normalization;
  const auto read = [&](const std::string& name, float(&target)[3]) {
    const std::vector<float> values = weights.get("normalization." + name, {3});
    std::copy(values.begin(), values.end(), target);
  };
  const auto read_deviation = [&](const std::string& name, float(&target)[3]) {
    read(name, target);
    for (const float deviation : target)
      if (!(deviation > 0))
        throw InputError("'" + weights.file + "': normalization." + name + " is not a standard deviation (" +
                         std::to_string(deviation) + ", allowed > 0). Export the weights again");
  };
  read("velocity_mean", normalization.velocity_mean);
  read_deviation("velocity_std", normalization.velocity_std);
  read("acceleration_mean", normalization.acceleration_mean);
  read_deviation("acceleration_std", normalization.acceleration_std);
  return normalization;
}

void add_normalization(nn::Weights& weights, const Normalization& normalization) {
  const auto add = [&](const std::string& name, const float(&values)[3]) {
    weights.tensors["normalization." + name] = nn::Tensor::from_float({values, values + 3}, {3});
  };
  add("velocity_mean", normalization.velocity_mean);
  add("velocity_std", normalization.velocity_std);
  add("acceleration_mean", normalization.acceleration_mean);
  add("acceleration_std", normalization.acceleration_std);
}

}  // namespace graupel::graph
