#include "experiments/export/frame_range.h"

#include <fmt/format.h>

#include <charconv>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

/// The words between colons.
std::vector<std::string> parts_of(const std::string& text) {
  std::vector<std::string> parts = {""};
  for (const char c : text) {
    if (c == ':')
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

}  // namespace

std::vector<int64_t> parse_frame_range(const std::string& text, int64_t frame_count, const std::string& where) {
  const int64_t last_frame = frame_count - 1;
  const auto fail = [&](const std::string& problem) {
    throw ConfigError(fmt::format("--frames '{}': {}. '{}' has frames 0 to {}; write FIRST:LAST:STRIDE, as in 0:{}:2",
                                  text, problem, where, last_frame, last_frame));
  };
  const std::vector<std::string> parts = parts_of(text);
  if (parts.size() > 3) fail(fmt::format("it has {} parts (allowed: 1 to 3)", parts.size()));
  const auto number = [&](std::size_t part, const char* name, int64_t absent, int64_t low, int64_t high) {
    if (part >= parts.size() || parts[part].empty()) return absent;
    const std::string& word = parts[part];
    int64_t value = 0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (code != std::errc() || end != word.data() + word.size() || value < low || value > high)
      fail(fmt::format("{} is '{}' (allowed: whole numbers from {} to {})", name, word, low, high));
    return value;
  };
  const int64_t first = number(0, "FIRST", 0, 0, last_frame);
  const bool one_frame = parts.size() == 1 && !text.empty();
  const int64_t last = number(1, "LAST", one_frame ? first : last_frame, first, last_frame);
  const int64_t stride = number(2, "STRIDE", 1, 1, frame_count);
  std::vector<int64_t> frames;
  for (int64_t frame = first; frame <= last; frame += stride) frames.push_back(frame);
  return frames;
}

}  // namespace graupel::experiments
