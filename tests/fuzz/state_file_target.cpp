// Files of saved runs: the container, its header and the scene inside. Checksums are made right.
#include <cstring>

#include "core/system/fnv1a.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/state_file.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/json_mutator.h"

namespace graupel::fuzz {

namespace {

constexpr std::size_t first_line = 16, length_bytes = 8, checksum_bytes = 8;

std::string with_checksum(std::string bytes) {
  if (bytes.size() < first_line + length_bytes + checksum_bytes) return bytes;
  const std::size_t content = bytes.size() - checksum_bytes;
  const uint64_t sum = fnv1a(fnv_start, bytes.data(), content);
  std::memcpy(bytes.data() + content, &sum, checksum_bytes);
  return bytes;
}

void run_state_file(const std::string& bytes) {
  const std::string path = file_with(with_checksum(bytes), "input.state");
  const io::SavedRun run = io::read_state_file(path);
  const std::string again = file_with("", "again.state");
  io::write_state_file(again, run);
  const io::SavedRun back = io::read_state_file(again);
  expect(back.state == run.state && back.recent.size() == run.recent.size() && back.scene_json == run.scene_json,
         "a state file that was written reads back as another one");
  static_cast<void>(io::parse_stored_scene(run.scene_json, "scene in the state", path));
}

/// The header or the scene as JSON, lengths kept right.
std::string mutate_state_file(const std::string& bytes, std::size_t most, Random& random) {
  uint64_t length = 0;
  if (bytes.size() < first_line + length_bytes || random() % 4 == 0) return mutate_bytes(bytes, most);
  std::memcpy(&length, bytes.data() + first_line, length_bytes);
  if (length > bytes.size() - first_line - length_bytes) return mutate_bytes(bytes, most);
  std::string header = bytes.substr(first_line + length_bytes, length),
              rest = bytes.substr(first_line + length_bytes + length);
  Json json = Json::parse(header, nullptr, false);
  if (random() % 3 == 0 && json.is_object() && json.contains("scene_bytes") &&
      json["scene_bytes"].is_number_unsigned() && json["scene_bytes"].get<uint64_t>() <= rest.size()) {
    const auto scene_bytes = json["scene_bytes"].get<uint64_t>();
    const std::string scene_text = mutate_json_text(rest.substr(0, scene_bytes), most, random);
    rest = scene_text + rest.substr(scene_bytes);
    json["scene_bytes"] = scene_text.size();
    header = json.dump();
  } else {
    header = mutate_json_text(header, most, random);
  }
  length = header.size();
  return bytes.substr(0, first_line) + std::string(reinterpret_cast<const char*>(&length), length_bytes) + header +
         rest;
}

}  // namespace

const Target targets::state_file = {"state_file", run_state_file, mutate_state_file};

}  // namespace graupel::fuzz
