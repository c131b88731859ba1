// Matrices of a network in 8 bits: row r of W [rows, columns] is kept as integers q in [-127, 127] and one f32 scale,
// W_rc = scale_r q_rc with scale_r = max_c |W_rc| / 127, so an entry is off by at most scale_r / 2. Files hold the
// integers as NAME (I8) and the scales as NAME.scale (F32 [rows]). Symmetric quantization of each output, the usual
// choice for weights (Jacob et al. 2018, section 2; Krishnamoorthi 2018, section 3.1). Products are not in integers:
// a file is read into f32.
#pragma once

#include "nn/weights.h"

namespace graupel::nn {

/// Every float tensor [rows, columns] whose name ends with ".weight" in 8 bits, but for those whose name begins with
/// one of `keep`; they and the other floats in f16; integers stay. Throws ConfigError where no matrix is left, for a
/// word of `keep` that no tensor begins with, and for a number that is not finite or too large for f16.
void quantize_matrices(Weights& weights, const std::vector<std::string>& keep = {});

/// The inverse: I8 tensors and their scales become f32. Throws InputError for one whose scales are missing, have
/// another shape or are not finite, naming `weights.file` and the tensor.
void expand_quantized(Weights& weights);

}  // namespace graupel::nn
