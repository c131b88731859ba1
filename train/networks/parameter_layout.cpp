#include "train/networks/parameter_layout.h"

#include <algorithm>
#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::train {

namespace {
constexpr int64_t alignment = 64;  // numbers: every tensor starts on a 256-byte boundary
}

ParameterLayout::ParameterLayout(graph::LayerPlan plan) : plan_(std::move(plan)) {
  for (graph::PlanTensor& tensor : plan_.tensors()) {
    int64_t count = 1;
    for (const int64_t n : tensor.shape) count *= n;
    parameters_.push_back({std::move(tensor), size_, count});
    size_ += (count + alignment - 1) / alignment * alignment;
    count_ += count;
  }
}

const Parameter& ParameterLayout::find(const std::string& name) const {
  const auto at =
      std::find_if(parameters_.begin(), parameters_.end(), [&](const Parameter& p) { return p.name == name; });
  GRAUPEL_ASSERT(at != parameters_.end());
  return *at;
}

std::vector<float> ParameterLayout::initial_values(uint64_t seed) const {
  std::vector<float> flat(static_cast<std::size_t>(size_), 0.0f);
  for (std::size_t p = 0; p < parameters_.size(); ++p) {
    const Parameter& parameter = parameters_[p];
    const Random random(seed, RandomPurpose::weight_init, p);
    float* const values = flat.data() + parameter.begin;
    const double bound = parameter.fan_in > 0 ? 1 / std::sqrt(static_cast<double>(parameter.fan_in)) : 0;
    for (int64_t i = 0; i < parameter.count; ++i) {
      const auto draw = static_cast<uint64_t>(i / 4);
      const int c = static_cast<int>(i % 4);
      if (parameter.fan_in > 0) {
        values[i] = static_cast<float>(random.uniform(draw, c, -bound, bound));
      } else if (parameter.name == "embedding.weight") {
        double a, b;
        random.normal(draw, c / 2, a, b);
        values[i] = static_cast<float>(c % 2 == 0 ? a : b);
      } else {
        values[i] = parameter.name.ends_with(".norm.weight") ? 1.0f : 0.0f;
      }
    }
  }
  return flat;
}

nn::Weights ParameterLayout::to_weights(const std::vector<float>& flat) const {
  GRAUPEL_ASSERT(static_cast<int64_t>(flat.size()) == size_);
  nn::Weights weights;
  for (const Parameter& p : parameters_)
    weights.tensors[p.name] =
        nn::Tensor::from_float({flat.begin() + p.begin, flat.begin() + p.begin + p.count}, p.shape);
  return weights;
}

std::vector<float> ParameterLayout::from_weights(const nn::Weights& weights) const {
  std::vector<float> flat(static_cast<std::size_t>(size_), 0.0f);
  for (const Parameter& p : parameters_) {
    const std::vector<float> values = weights.get(p.name, p.shape);
    std::copy(values.begin(), values.end(), flat.begin() + p.begin);
  }
  return flat;
}

}  // namespace graupel::train
