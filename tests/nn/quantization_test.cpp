#include "nn/quantization.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "core/math/random.h"
#include "core/system/error.h"
#include "nn/number_width.h"

namespace graupel::nn {
namespace {

class Quantization : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::temp_directory_path() / ("graupel_i8_" + std::to_string(::getpid()) + ".safetensors");
  }
  void TearDown() override { std::filesystem::remove(path_); }

  /// A matrix of rows of very different size, one of zeros; a bias, a tensor of three axes and integers.
  static Weights network() {
    Weights weights;
    std::vector<float> matrix(rows * columns);
    const Random random(5, RandomPurpose::test);
    for (std::size_t i = 0; i < matrix.size(); ++i) {
      const std::size_t row = i / columns;
      const float size = row == 2 ? 0.0f : std::pow(10.0f, static_cast<float>(row) - 3);
      double first = 0, second = 0;
      random.normal(i, 0, first, second);
      matrix[i] = size * static_cast<float>(first);
    }
    weights.tensors["layer.weight"] = Tensor::from_float(matrix, {rows, columns});
    weights.tensors["layer.bias"] = Tensor::from_float({0.1f, -2, 3}, {3});
    weights.tensors["field.basis"] = Tensor::from_float({1, 2, 3, 4}, {1, 2, 2});
    weights.tensors["types"] = {.dtype = DType::i32, .shape = {2}, .bytes = std::vector<std::byte>(8, std::byte{2})};
    weights.metadata["architecture"] = "some";
    return weights;
  }
  std::string error() const {
    try {
      read_safetensors(path_);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  static constexpr int64_t rows = 5, columns = 40;
  std::string path_;
};

TEST_F(Quantization, EveryEntryIsOffByAtMostHalfAStepOfItsRow) {
  const Weights whole = network();
  Weights small = whole;
  set_number_width(small, "i8");
  EXPECT_EQ(small.tensors.at("layer.weight").dtype, DType::i8);
  EXPECT_EQ(small.tensors.at("layer.bias").dtype, DType::f16);
  EXPECT_EQ(small.tensors.at("field.basis").dtype, DType::f16);
  EXPECT_EQ(small.tensors.at("types").bytes, whole.tensors.at("types").bytes);
  write_safetensors(path_, small);

  const Weights read = read_safetensors(path_);
  EXPECT_EQ(read.metadata, whole.metadata);
  ASSERT_EQ(read.tensors.size(), whole.tensors.size());  // the scales are gone
  const auto is = read.get("layer.weight", {rows, columns}), was = whole.get("layer.weight", {rows, columns});
  for (std::size_t row = 0; row < rows; ++row) {
    float peak = 0, largest_error = 0;
    for (std::size_t c = 0; c < columns; ++c) {
      peak = std::max(peak, std::abs(was[row * columns + c]));
      largest_error = std::max(largest_error, std::abs(is[row * columns + c] - was[row * columns + c]));
    }
    EXPECT_LE(largest_error, 0.5001f * peak / 127) << row;
    EXPECT_EQ(largest_error > 0, peak > 0) << row;
  }
}

TEST_F(Quantization, ASecondTimeChangesNothing) {
  Weights once = network();
  quantize_matrices(once);
  Weights expanded = once;
  expand_quantized(expanded);
  Weights twice = expanded;
  quantize_matrices(twice);
  EXPECT_EQ(twice.tensors.at("layer.weight").bytes, once.tensors.at("layer.weight").bytes);
}

TEST_F(Quantization, WhatIsKeptStaysIn16Bits) {
  Weights weights = network();
  weights.tensors["encoder.weight"] = weights.tensors.at("layer.weight");
  quantize_matrices(weights, {"enc"});
  EXPECT_EQ(weights.tensors.at("encoder.weight").dtype, DType::f16);
  EXPECT_EQ(weights.tensors.at("layer.weight").dtype, DType::i8);
  weights = network();
  EXPECT_THROW(quantize_matrices(weights, {"decoder"}), ConfigError);  // no such tensor
  EXPECT_THROW(quantize_matrices(weights, {"layer"}), ConfigError);    // nothing is left
  EXPECT_THROW(set_number_width(weights, "f16", {"layer"}), ConfigError);
}

TEST_F(Quantization, WithoutMatricesOfANetworkItIsRefused) {
  Weights weights = network();
  weights.tensors.erase("layer.weight");
  weights.file = "reduced.safetensors";
  try {
    quantize_matrices(weights);
    FAIL();
  } catch (const ConfigError& e) {
    EXPECT_NE(std::string(e.what()).find("'reduced.safetensors' has no matrices"), std::string::npos) << e.what();
  }
  weights = network();
  weights.tensors["layer.weight"] = Tensor::from_float({1, NAN}, {1, 2});
  EXPECT_THROW(quantize_matrices(weights), ConfigError);
}

TEST_F(Quantization, DamagedScalesAreNamed) {
  Weights weights = network();
  quantize_matrices(weights);
  const Tensor scales = weights.tensors.at("layer.weight.scale");
  weights.tensors.erase("layer.weight.scale");
  write_safetensors(path_, weights);
  EXPECT_NE(error().find("'layer.weight.scale' is missing"), std::string::npos) << error();
  weights.tensors["layer.weight.scale"] = Tensor::from_float({1, 2}, {2});
  write_safetensors(path_, weights);
  EXPECT_NE(error().find("another shape"), std::string::npos) << error();
  weights.tensors["layer.weight.scale"] = Tensor::from_float({1, 2, INFINITY, 1, 1}, {rows});
  write_safetensors(path_, weights);
  EXPECT_NE(error().find("is damaged"), std::string::npos) << error();
  weights.tensors["layer.weight.scale"] = scales;
  weights.tensors["odd"] = {.dtype = DType::i8, .shape = {3}, .bytes = std::vector<std::byte>(3)};
  write_safetensors(path_, weights);
  EXPECT_NE(error().find("'odd' is in 8 bits and no matrix"), std::string::npos) << error();
}

}  // namespace
}  // namespace graupel::nn
