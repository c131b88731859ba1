#include "tests/fuzz/weights_mutator.h"

#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <vector>

#include "tests/fuzz/json_mutator.h"

namespace graupel::fuzz {

namespace {

constexpr std::size_t length_bytes = 8;

struct StoredTensor {
  std::string name;
  Json dtype, shape;
  std::string bytes;
};

struct File {
  Json metadata;
  std::vector<StoredTensor> tensors;
};

/// False for bytes that hold no safetensors file.
bool parse(const std::string& bytes, File& file) {
  uint64_t length = 0;
  if (bytes.size() < length_bytes) return false;
  std::memcpy(&length, bytes.data(), length_bytes);
  if (length > bytes.size() - length_bytes) return false;
  const Json header = Json::parse(bytes.substr(length_bytes, length), nullptr, false);
  const std::string data = bytes.substr(length_bytes + length);
  if (!header.is_object()) return false;
  for (const auto& [name, entry] : header.items()) {
    if (name == "__metadata__") {
      file.metadata = entry;
      continue;
    }
    if (!entry.is_object() || !entry.contains("data_offsets") || !entry.contains("dtype") || !entry.contains("shape"))
      return false;
    const Json& range = entry["data_offsets"];
    if (!range.is_array() || range.size() != 2 || !range[0].is_number_unsigned() || !range[1].is_number_unsigned())
      return false;
    const auto begin = range[0].get<uint64_t>(), end = range[1].get<uint64_t>();
    if (begin > end || end > data.size()) return false;
    file.tensors.push_back({name, entry["dtype"], entry["shape"], data.substr(begin, end - begin)});
  }
  return true;
}

std::string text_of(const File& file) {
  Json header = Json::object();
  if (!file.metadata.is_null()) header["__metadata__"] = file.metadata;
  std::string data;
  for (const StoredTensor& t : file.tensors) {
    header[t.name] = {
        {"dtype", t.dtype}, {"shape", t.shape}, {"data_offsets", {data.size(), data.size() + t.bytes.size()}}};
    data += t.bytes;
  }
  const std::string text = header.dump(-1, ' ', false, Json::error_handler_t::replace);
  const uint64_t length = text.size();
  return std::string(reinterpret_cast<const char*>(&length), length_bytes) + text + data;
}

/// A float or an integer of four bytes that is far from what is there.
void change_number(std::string& bytes, Random& random) {
  constexpr std::size_t width = sizeof(float);
  if (bytes.size() < width) return;
  constexpr float floats[] = {0,
                              -0.0f,
                              1,
                              -1,
                              1e-30f,
                              1e10f,
                              -1e10f,
                              1e30f,
                              3e38f,
                              std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::quiet_NaN()};
  constexpr int32_t integers[] = {
      0, 1, -1, 2, 7, 1000, 1 << 20, std::numeric_limits<int32_t>::max(), std::numeric_limits<int32_t>::min()};
  char* at = bytes.data() + random() % (bytes.size() / width) * width;
  if (random() % 2 == 0)
    std::memcpy(at, &floats[random() % std::size(floats)], width);
  else
    std::memcpy(at, &integers[random() % std::size(integers)], width);
}

/// Makes the shape's length along an axis another one, and the bytes fit it.
void change_extent(StoredTensor& t, Random& random) {
  if (!t.shape.is_array() || t.shape.empty()) return;
  Json& extent = t.shape[random() % t.shape.size()];
  if (!extent.is_number_unsigned() || extent.get<uint64_t>() == 0) return;
  const auto old = extent.get<uint64_t>();
  const uint64_t wanted = random() % 3 == 0 ? 0 : random() % 2 == 0 ? old + 1 : old - 1;
  extent = wanted;
  t.bytes.resize(t.bytes.size() / old * wanted);
}

void mutate_tensor(File& file, Random& random) {
  const std::size_t at = random() % file.tensors.size();
  StoredTensor& t = file.tensors[at];
  switch (random() % 8) {
    case 0:
      file.tensors.erase(file.tensors.begin() + static_cast<std::ptrdiff_t>(at));
      return;
    case 1:
      t.name = mutate_bytes(t.name, t.name.size() + 4);
      return;
    case 2: {
      const StoredTensor& other = file.tensors[random() % file.tensors.size()];
      t.dtype = other.dtype, t.shape = other.shape, t.bytes = other.bytes;
      return;
    }
    case 3:
      mutate_json(t.shape, random);
      return;
    case 4:
      change_extent(t, random);
      return;
    case 5:
      t.bytes = mutate_bytes(t.bytes, t.bytes.size());
      return;
    default:
      change_number(t.bytes, random);
  }
}

/// A value that is JSON itself (the scene, the settings) is changed as such.
void mutate_metadata(Json& metadata, Random& random) {
  if (!metadata.is_object() || metadata.empty() || random() % 16 == 0) return mutate_json(metadata, random);
  Json& value = *std::next(metadata.begin(), static_cast<std::ptrdiff_t>(random() % metadata.size()));
  if (!value.is_string()) return mutate_json(metadata, random);
  const auto text = value.get<std::string>();
  if (!text.empty() && text.front() == '{')
    value = mutate_json_text(text, text.size() + 64, random);
  else
    value = random() % 2 == 0 ? edge_number(random) : mutate_bytes(text, text.size() + 4);
}

}  // namespace

std::string mutate_weights(const std::string& bytes, std::size_t most, Random& random) {
  File file;
  if (random() % 8 == 0 || !parse(bytes, file)) return mutate_bytes(bytes, most);
  if (file.tensors.empty() || random() % 2 == 0)
    mutate_metadata(file.metadata, random);
  else
    mutate_tensor(file, random);
  return text_of(file);
}

}  // namespace graupel::fuzz
