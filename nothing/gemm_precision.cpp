#include <cstdlib>
#include <string>

#include "core/system/error.h"
#include "nn/bf16_gemm.h"

namespace graupel::nn {

bool has_bf16_units() { return available_bf16_units() != Bf16Extension::none; }
void set_bf16_gemm(bool use) { use_bf16_units(use ? available_bf16_units() : Bf16Extension::none); }
bool uses_bf16_gemm() { return bf16_units_in_use() != Bf16Extension::none; }

void choose_gemm_precision() {
  const char* const wanted = std::getenv("GRAUPEL_PRODUCTS");
  const std::string word = wanted == nullptr ? "" : wanted;
  if (!word.empty() && word != "f32" && word != "bf16" && word != "bf16-vectors")
    throw ConfigError("GRAUPEL_PRODUCTS='" + word +
                      "' is not known (allowed: f32, bf16, bf16-vectors). Unset it for the fastest");
  if (word.starts_with("bf16") && !has_bf16_units())
    throw ConfigError("GRAUPEL_PRODUCTS=" + word + ": this processor has no units for it (AMX, AVX512_BF16). Unset it");
  use_bf16_units(word == "f32"            ? Bf16Extension::none
                 : word == "bf16-vectors" ? Bf16Extension::vectors
                 : word == "bf16"         ? available_bf16_units()
                                          : fastest_bf16_units());
}

const char* gemm_precision_name() {
  switch (bf16_units_in_use()) {
    case Bf16Extension::matrices:
      return "bf16 products on matrix units";
    case Bf16Extension::vectors:
      return "bf16 products on vector units";
    case Bf16Extension::none:
      break;
  }
  return "f32 products";
}

}  // namespace graupel::nn
