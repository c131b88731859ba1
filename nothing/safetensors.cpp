// Strict reader and deterministic writer of safetensors files. The reader trusts nothing in the header: sizes are
// checked for overflow, ranges must tile the data section without overlap or hole, names must be unique.
#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "nn/quantization.h"
#include "nn/weights.h"

namespace graupel::nn {

namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little, "safetensors data is little-endian");

constexpr uint64_t max_header = 100'000'000;
constexpr std::size_t max_file = std::size_t(1) << 36;
constexpr std::size_t max_dimensions = 8;
constexpr std::size_t length_bytes = 8;
constexpr const char* metadata_key = "__metadata__";

constexpr std::pair<const char*, DType> dtype_words[] = {
    {"F64", DType::f64}, {"F32", DType::f32}, {"F16", DType::f16}, {"BF16", DType::bf16},
    {"I64", DType::i64}, {"I32", DType::i32}, {"I8", DType::i8},   {"U8", DType::u8}};

/// A string from the file, quoted, escaped and cut, for messages.
std::string quoted(const std::string& text) {
  return Json(text.substr(0, 80)).dump(-1, ' ', true, Json::error_handler_t::replace);
}

/// Builds every message of this reader.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), bytes_(read_file(path, max_file)) {}

  Weights read() {
    const Json header = parse_header();
    Weights weights;
    weights.file = path_;
    for (const auto& [name, entry] : header.items()) {
      if (name == metadata_key)
        read_metadata(entry, weights);
      else
        read_entry(name, entry, weights);
    }
    check_ranges();
    for (const Range& range : ranges_) {
      const auto* begin = reinterpret_cast<const std::byte*>(bytes_.data()) + data_begin_ + range.begin;
      range.tensor->bytes.assign(begin, begin + (range.end - range.begin));
    }
    return weights;
  }

 private:
  struct Range {
    uint64_t begin, end;
    std::string name;
    Tensor* tensor;
  };

  [[noreturn]] void fail(const std::string& problem) const {
    throw InputError("'" + path_ + "' is not a valid safetensors file: " + problem +
                     ". It may be truncated or of another kind; copy or export it again");
  }

  Json parse_header() {
    if (bytes_.size() < length_bytes)
      fail("it is shorter than the 8-byte header length (" + std::to_string(bytes_.size()) + " bytes)");
    uint64_t length = 0;
    std::memcpy(&length, bytes_.data(), length_bytes);
    const uint64_t room = bytes_.size() - length_bytes;
    if (length > max_header || length > room)
      fail("the header length does not fit (" + std::to_string(length) + " bytes, at most " +
           std::to_string(std::min(room, max_header)) + ")");
    if (length == 0 || bytes_[length_bytes] != '{') fail("the header does not start with '{'");
    data_begin_ = length_bytes + length;
    const char* begin = bytes_.data() + length_bytes;
    try {
      return Json::parse(begin, begin + length, duplicate_check());
    } catch (const Json::exception& error) {
      fail(std::string("the header is not JSON (") + quoted(error.what()) + ")");
    }
  }

  /// The DOM keeps the last of two equal keys, so they are found while parsing. Also limits the depth.
  Json::parser_callback_t duplicate_check() const {
    return
        [this, keys = std::vector<std::set<std::string>>()](int depth, Json::parse_event_t event, Json& value) mutable {
          if (depth > 3) fail("the header is nested too deeply");
          if (event == Json::parse_event_t::object_start) keys.emplace_back();
          if (event == Json::parse_event_t::object_end) keys.pop_back();
          if (event == Json::parse_event_t::key && !keys.back().insert(value.get<std::string>()).second)
            fail("the key " + quoted(value.get<std::string>()) + " occurs twice in the header");
          return true;
        };
  }

  void read_metadata(const Json& entry, Weights& weights) const {
    if (!entry.is_object()) fail("__metadata__ is not an object");
    for (const auto& [key, value] : entry.items()) {
      if (!value.is_string()) fail("the metadata value of " + quoted(key) + " is not a string");
      weights.metadata[key] = value.get<std::string>();
    }
  }

  void read_entry(const std::string& name, const Json& entry, Weights& weights) {
    const std::string tensor_name = "tensor " + quoted(name);
    if (!entry.is_object() || entry.size() != 3 || !entry.contains("dtype") || !entry.contains("shape") ||
        !entry.contains("data_offsets"))
      fail(tensor_name + " does not have exactly dtype, shape and data_offsets");
    Tensor& tensor = weights.tensors[name];
    tensor.dtype = read_dtype(tensor_name, entry["dtype"]);
    const uint64_t size = read_shape(tensor_name, entry["shape"], tensor);
    const Json& offsets = entry["data_offsets"];
    if (!offsets.is_array() || offsets.size() != 2 || !offsets[0].is_number_unsigned() ||
        !offsets[1].is_number_unsigned())
      fail("data_offsets of " + tensor_name + " are not two unsigned integers");
    const auto begin = offsets[0].get<uint64_t>(), end = offsets[1].get<uint64_t>();
    if (end < begin || end - begin != size)
      fail("data_offsets of " + tensor_name + " do not fit its shape (" + std::to_string(begin) + " to " +
           std::to_string(end) + ", " + std::to_string(size) + " bytes needed)");
    ranges_.push_back({begin, end, tensor_name, &tensor});
  }

  DType read_dtype(const std::string& tensor_name, const Json& word) const {
    if (word.is_string())
      for (const auto& [text, dtype] : dtype_words)
        if (word.get_ref<const std::string&>() == text) return dtype;
    fail(tensor_name + " has an unknown dtype (" + quoted(word.dump(-1, ' ', true, Json::error_handler_t::replace)) +
         ", known F64 F32 F16 BF16 I64 I32 I8 U8)");
  }

  /// Fills tensor.shape and returns the bytes that it needs.
  uint64_t read_shape(const std::string& tensor_name, const Json& shape, Tensor& tensor) const {
    if (!shape.is_array() || shape.size() > max_dimensions)
      fail("the shape of " + tensor_name + " is not an array of at most 8 integers");
    uint64_t size = size_of(tensor.dtype);
    for (const Json& extent : shape) {
      if (!extent.is_number_unsigned()) fail("the shape of " + tensor_name + " is not made of unsigned integers");
      const auto n = extent.get<uint64_t>();
      if (n > static_cast<uint64_t>(std::numeric_limits<int64_t>::max()) || __builtin_mul_overflow(size, n, &size))
        fail("the size of " + tensor_name + " overflows");
      tensor.shape.push_back(static_cast<int64_t>(n));
    }
    return size;
  }

  /// Sorted ranges must tile the data section exactly.
  void check_ranges() {
    std::sort(ranges_.begin(), ranges_.end(),
              [](const Range& a, const Range& b) { return std::pair(a.begin, a.end) < std::pair(b.begin, b.end); });
    uint64_t position = 0;
    for (const Range& range : ranges_) {
      if (range.begin < position) fail(range.name + " overlaps the one before it");
      if (range.begin > position) fail("there is a hole before " + range.name);
      position = range.end;
    }
    const uint64_t data = bytes_.size() - data_begin_;
    if (position != data)
      fail("the tensors do not end where the file ends (" + std::to_string(position) + " bytes of tensors, " +
           std::to_string(data) + " bytes of data)");
  }

  std::string path_, bytes_;
  uint64_t data_begin_ = 0;
  std::vector<Range> ranges_;
};

const char* word_of_dtype(DType dtype) {
  for (const auto& [text, value] : dtype_words)
    if (value == dtype) return text;
  throw std::logic_error("safetensors: not a DType");
}

}  // namespace

Weights read_safetensors(const std::string& path) {
  Weights weights = Reader(path).read();
  expand_quantized(weights);
  return weights;
}

void write_safetensors(const std::string& path, const Weights& weights) {
  Json header = Json::object();
  if (!weights.metadata.empty()) header[metadata_key] = weights.metadata;
  uint64_t position = 0;
  for (const auto& [name, tensor] : weights.tensors) {
    GRAUPEL_ASSERT(name != metadata_key && tensor.shape.size() <= max_dimensions);
    GRAUPEL_ASSERT(tensor.bytes.size() == static_cast<std::size_t>(tensor.count()) * size_of(tensor.dtype));
    const uint64_t end = position + tensor.bytes.size();
    header[name] = {{"dtype", word_of_dtype(tensor.dtype)}, {"shape", tensor.shape}, {"data_offsets", {position, end}}};
    position = end;
  }
  std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + length_bytes - 1) / length_bytes * length_bytes, ' ');  // aligns the data
  const uint64_t length = text.size();
  std::string bytes(length_bytes, '\0');
  std::memcpy(bytes.data(), &length, length_bytes);
  bytes += text;
  bytes.reserve(bytes.size() + position);
  for (const auto& [name, tensor] : weights.tensors)
    bytes.append(reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size());
  write_file_atomically(path, bytes);
}

}  // namespace graupel::nn
