#include <cstdlib>
#include <string>

#include "core/error.h"
#include "nn/bf16_products.h"

namespace graupel::nn {

void choose_products() {
  const char* const wanted = std::getenv("GRAUPEL_PRODUCTS");
  const std::string word = wanted == nullptr ? "" : wanted;
  if (!word.empty() && word != "f32" && word != "bf16")
    throw ConfigError("GRAUPEL_PRODUCTS='" + word + "' is not known (allowed: f32, bf16). Unset it for the fastest");
  if (word == "bf16" && !has_bf16_units())
    throw ConfigError("GRAUPEL_PRODUCTS=bf16: this processor has no matrix units for it (AMX). Unset it");
  use_bf16_products(word != "f32");
}

}  // namespace graupel::nn
