// Named tensors in a safetensors file: 8-byte little-endian header length, JSON header, raw little-endian data.
// Format: https://huggingface.co/docs/safetensors. The reader is strict: it accepts what the format allows, no more.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace graupel::nn {

enum class DType { f64, f32, f16, bf16, i64, i32, i8, u8 };

/// Bytes of one element.
std::size_t size_of(DType dtype);

/// 16-bit floats: IEEE 754 binary16 and bfloat16. Narrowing rounds to nearest even and keeps NaN.
float float_from_f16(uint16_t bits);
float float_from_bf16(uint16_t bits);
uint16_t f16_from_float(float value);
uint16_t bf16_from_float(float value);

struct Tensor {
  DType dtype = DType::f32;
  std::vector<int64_t> shape;    ///< row-major
  std::vector<std::byte> bytes;  ///< raw little-endian

  int64_t count() const;                ///< product of shape
  std::vector<float> as_float() const;  ///< f64/f32/f16/bf16 widened or rounded to f32; InputError for integers
  /// `dtype` is one of f64, f32, f16, bf16.
  static Tensor from_float(const std::vector<float>& values, std::vector<int64_t> shape, DType dtype = DType::f32);
};

/// Tensors and string metadata of a file. Names are sorted, so equal contents give equal bytes.
struct Weights {
  std::map<std::string, Tensor> tensors;
  std::map<std::string, std::string> metadata;

  /// Tensor `name` as f32; throws InputError (naming `file`) unless it is there, has `shape` and holds finite floats.
  std::vector<float> get(const std::string& name, const std::vector<int64_t>& shape) const;
  std::string file;  ///< where it was read from, for messages
};

/// Matrices in 8 bits (nn/quantization.h) come as f32. Throws InputError: missing, truncated, wrong magic, unknown
/// dtype, overlapping or missing ranges, duplicate names, 8 bits without scales.
Weights read_safetensors(const std::string& path);
/// Written aside, synced, renamed. Throws IoError.
void write_safetensors(const std::string& path, const Weights& weights);

}  // namespace graupel::nn
