#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/math/random.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "nn/weights.h"

namespace graupel::nn {
namespace {

class Safetensors : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("graupel_safetensors_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "w.safetensors").string();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static Weights example() {
    Weights weights;
    weights.metadata = {{"architecture", "hgn"}, {"note", "two\nlines \"quoted\" \xC3\xA9"}};
    weights.tensors["b"] = Tensor::from_float({1.5f, -2, 3, 4, 5, 6}, {2, 3});
    weights.tensors["a"] = Tensor::from_float({0.5f}, {});
    weights.tensors["half"] = Tensor::from_float({1, 2, -0.25f}, {3}, DType::f16);
    weights.tensors["brain"] = Tensor::from_float({1, 2, -0.25f}, {3, 1}, DType::bf16);
    weights.tensors["wide"] = Tensor::from_float({1, 2}, {2}, DType::f64);
    weights.tensors["empty"] = Tensor::from_float({}, {0, 4});
    weights.tensors["step"] = {.dtype = DType::i64, .shape = {1}, .bytes = std::vector<std::byte>(8, std::byte{1})};
    weights.tensors["random"] = {.dtype = DType::u8, .shape = {5}, .bytes = std::vector<std::byte>(5, std::byte{7})};
    weights.tensors["types"] = {.dtype = DType::i32, .shape = {2}, .bytes = std::vector<std::byte>(8, std::byte{2})};
    return weights;
  }

  void put(const std::string& header, std::size_t data_bytes) const { put_raw(header.size(), header, data_bytes); }
  void put_raw(uint64_t length, const std::string& header, std::size_t data_bytes) const {
    std::string bytes(8, '\0');
    std::memcpy(bytes.data(), &length, 8);
    put_bytes(bytes + header + std::string(data_bytes, '\0'));
  }
  void put_bytes(const std::string& bytes) const {
    std::ofstream(path_, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  /// Message of the InputError that reading gives, "" when the file is read.
  std::string error() const {
    try {
      read_safetensors(path_);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  std::filesystem::path folder_;
  std::string path_;
};

#define EXPECT_ERROR(text) EXPECT_NE(error().find(text), std::string::npos) << "got: " << error()

TEST_F(Safetensors, RoundTripKeepsEverythingAndBytesAreDeterministic) {
  const Weights written = example();
  write_safetensors(path_, written);
  const Weights read = read_safetensors(path_);
  EXPECT_EQ(read.file, path_);
  EXPECT_EQ(read.metadata, written.metadata);
  ASSERT_EQ(read.tensors.size(), written.tensors.size());
  for (const auto& [name, tensor] : written.tensors) {
    const Tensor& other = read.tensors.at(name);
    EXPECT_EQ(other.dtype, tensor.dtype) << name;
    EXPECT_EQ(other.shape, tensor.shape) << name;
    EXPECT_EQ(other.bytes, tensor.bytes) << name;
  }
  EXPECT_EQ(read.get("half", {3}), (std::vector<float>{1, 2, -0.25f}));
  EXPECT_EQ(read.get("brain", {3, 1}), (std::vector<float>{1, 2, -0.25f}));
  EXPECT_EQ(read.get("wide", {2}), (std::vector<float>{1, 2}));
  const std::string first = read_file(path_);
  write_safetensors(path_, read);
  EXPECT_EQ(read_file(path_), first);
  EXPECT_FALSE(std::filesystem::exists(path_ + ".part"));
}

TEST_F(Safetensors, AFileWithoutTensorsIsValid) {
  write_safetensors(path_, Weights{});
  EXPECT_TRUE(read_safetensors(path_).tensors.empty());
}

TEST_F(Safetensors, EveryTruncationAndTrailingByteIsAnError) {
  write_safetensors(path_, example());
  const std::string whole = read_file(path_);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    put_bytes(whole.substr(0, n));
    ASSERT_NE(error(), "") << n << " of " << whole.size() << " bytes";
  }
  put_bytes(whole + '\0');
  EXPECT_ERROR("do not end where the file ends");
}

TEST_F(Safetensors, HeaderRules) {
  put_bytes("\x89HDF\r\n\x1a\n0123456789");
  EXPECT_ERROR("header length does not fit");
  put_raw(uint64_t(1) << 40, "{}", 0);
  EXPECT_ERROR("header length does not fit");
  put_raw(0, "", 8);
  EXPECT_ERROR("does not start with '{'");
  put("[1,2]", 0);
  EXPECT_ERROR("does not start with '{'");
  put(" {}", 0);
  EXPECT_ERROR("does not start with '{'");
  put("{\"a\":", 0);
  EXPECT_ERROR("not JSON");
  put("{}{}", 0);
  EXPECT_ERROR("not JSON");
  put("{\"a\xFF\":1}", 0);
  EXPECT_ERROR("not JSON");
  put("{\"a\":[[[[1]]]]}", 0);
  EXPECT_ERROR("too deeply");
  std::filesystem::remove(path_);
  EXPECT_NE(error(), "");
}

TEST_F(Safetensors, EntryRules) {
  const auto entry = [](const std::string& dtype, const std::string& shape, const std::string& offsets) {
    return "{\"t\":{\"dtype\":\"" + dtype + "\",\"shape\":" + shape + ",\"data_offsets\":" + offsets + "}}";
  };
  put(entry("F32", "[2]", "[0,8]"), 8);
  EXPECT_EQ(error(), "");
  put(entry("Q4", "[2]", "[0,8]"), 8);
  EXPECT_ERROR("unknown dtype");
  put(entry("F32", "[-2]", "[0,8]"), 8);
  EXPECT_ERROR("unsigned");
  put(entry("F32", "[2.0]", "[0,8]"), 8);
  EXPECT_ERROR("unsigned");
  put(entry("F32", "2", "[0,8]"), 8);
  EXPECT_ERROR("at most 8");
  put(entry("F32", "[1,1,1,1,1,1,1,1,2]", "[0,8]"), 8);
  EXPECT_ERROR("at most 8");
  put(entry("F32", "[4294967296,4294967296]", "[0,8]"), 8);
  EXPECT_ERROR("overflows");
  put(entry("U8", "[18446744073709551615]", "[0,8]"), 8);
  EXPECT_ERROR("overflows");
  put(entry("F32", "[3]", "[0,8]"), 8);
  EXPECT_ERROR("do not fit its shape");
  put(entry("F32", "[2]", "[8,0]"), 8);
  EXPECT_ERROR("do not fit its shape");
  put(entry("F32", "[2]", "[0,8,9]"), 8);
  EXPECT_ERROR("two unsigned");
  put(entry("F32", "[2]", "[0,\"8\"]"), 8);
  EXPECT_ERROR("two unsigned");
  put("{\"t\":{\"dtype\":\"F32\",\"shape\":[2]}}", 8);
  EXPECT_ERROR("exactly dtype");
  put("{\"t\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8],\"more\":1}}", 8);
  EXPECT_ERROR("exactly dtype");
  put("{\"__metadata__\":{\"step\":3}}", 0);
  EXPECT_ERROR("not a string");
  put("{\"__metadata__\":[]}", 0);
  EXPECT_ERROR("not an object");
}

TEST_F(Safetensors, RangesMustTileTheData) {
  const auto two = [](const std::string& a, const std::string& b) {
    return "{\"a\":{\"dtype\":\"U8\",\"shape\":[4],\"data_offsets\":" + a +
           "},\"b\":{\"dtype\":\"U8\",\"shape\":[4],\"data_offsets\":" + b + "}}";
  };
  put(two("[4,8]", "[0,4]"), 8);  // any order of names
  EXPECT_EQ(error(), "");
  put(two("[0,4]", "[2,6]"), 6);
  EXPECT_ERROR("overlaps");
  put(two("[0,4]", "[0,4]"), 4);
  EXPECT_ERROR("overlaps");
  put(two("[0,4]", "[5,9]"), 9);
  EXPECT_ERROR("hole");
  put(two("[1,5]", "[5,9]"), 9);
  EXPECT_ERROR("hole");
  put(two("[0,4]", "[4,8]"), 9);
  EXPECT_ERROR("do not end where");
}

TEST_F(Safetensors, DuplicateKeysAreFoundAtEveryLevel) {
  const std::string t = "{\"dtype\":\"U8\",\"shape\":[1],\"data_offsets\":[0,1]}";
  put("{\"a\":" + t + ",\"a\":" + t + "}", 1);
  EXPECT_ERROR("\"a\" occurs twice");
  put("{\"a\":{\"dtype\":\"U8\",\"dtype\":\"U8\",\"shape\":[1],\"data_offsets\":[0,1]}}", 1);
  EXPECT_ERROR("occurs twice");
  put("{\"__metadata__\":{\"k\":\"1\",\"k\":\"2\"}}", 0);
  EXPECT_ERROR("occurs twice");
}

TEST_F(Safetensors, RandomDamageGivesInputErrorOrAReadableFile) {
  write_safetensors(path_, example());
  const std::string whole = read_file(path_);
  uint64_t header = 0;
  std::memcpy(&header, whole.data(), 8);
  const Random random(11, RandomPurpose::test);
  const std::string alphabet = "{}[]\",:0123456789eE-+.\\FBIU \x80\xFF";
  int refused = 0;
  for (uint64_t i = 0; i < 3000; ++i) {
    std::string damaged = whole;
    const int edits = 1 + static_cast<int>(random.integer(i * 8, 0, 3));
    for (int e = 0; e < edits; ++e) {
      const uint64_t draw = i * 8 + 1 + static_cast<uint64_t>(e);
      const std::size_t at = random.integer(draw, 0, static_cast<uint32_t>(8 + header));
      const char letter = random.integer(draw, 1, 2)
                              ? alphabet[random.integer(draw, 2, static_cast<uint32_t>(alphabet.size()))]
                              : static_cast<char>(random.integer(draw, 2, 256));
      const uint32_t kind = random.integer(draw, 3, 3);
      if (kind == 0) damaged[at] = letter;
      if (kind == 1) damaged.insert(at, 1, letter);
      if (kind == 2) damaged.erase(at, 1 + random.integer(draw, 2, 20));
      if (damaged.size() <= 8 + header) damaged.resize(9 + header);
    }
    put_bytes(damaged);
    if (!error().empty()) ++refused;  // anything but InputError ends the test
  }
  EXPECT_GT(refused, 2000);
}

TEST_F(Safetensors, PythonReadsTheFileByTheFormatsRules) {
  if (std::system("python3 -c 'import struct, json' 2>/dev/null") != 0) GTEST_SKIP() << "needs python3";
  write_safetensors(path_, example());
  const std::string script = (folder_ / "read.py").string();
  std::ofstream(script) << R"(import json, struct, sys
data = open(sys.argv[1], 'rb').read()
n, = struct.unpack('<Q', data[:8])
assert n % 8 == 0
header = json.loads(data[8:8 + n])
def get(name, letter):
    b, e = header[name]['data_offsets']
    raw = data[8 + n + b:8 + n + e]
    return struct.unpack('<%d%s' % (len(raw) // struct.calcsize(letter), letter), raw)
assert header['__metadata__']['note'] == 'two\nlines "quoted" \u00e9'
assert header['b']['shape'] == [2, 3] and header['b']['dtype'] == 'F32'
assert get('b', 'f') == (1.5, -2, 3, 4, 5, 6)
assert header['a']['shape'] == [] and get('a', 'f') == (0.5,)
assert get('half', 'e') == (1, 2, -0.25)
assert get('wide', 'd') == (1, 2)
)";
  EXPECT_EQ(std::system(("python3 " + script + " " + path_).c_str()), 0);
}

}  // namespace
}  // namespace graupel::nn
