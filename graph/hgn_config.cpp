#include "graph/hgn_config.h"

#include <charconv>
#include <cmath>
#include <set>
#include <type_traits>

#include "core/error.h"

namespace graupel::graph {

namespace {

const std::string prefix = "hgn.";

template <typename T>
std::string text_of(T value) {
  if constexpr (std::is_same_v<T, bool>) {
    return value ? "true" : "false";
  } else {
    char text[64];  // the shortest text that reads back as the same number
    return std::string(text, std::to_chars(text, text + sizeof(text), value).ptr);
  }
}

/// False unless all of `text` is a value of this type.
template <typename T>
bool parse(const std::string& text, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    value = text == "true";
    return text == "true" || text == "false";
  } else {
    const char* end = text.data() + text.size();
    const auto [stop, status] = std::from_chars(text.data(), end, value);
    return status == std::errc() && stop == end;
  }
}

std::string range_text(const Range& range) {
  const auto bound = [](double x) { return std::isinf(x) ? std::string(x < 0 ? "-inf" : "inf") : text_of(x); };
  return (range.low_open ? "above " : "from ") + bound(range.low) + " to " + bound(range.high);
}

}  // namespace

std::map<std::string, std::string> HgnConfig::to_metadata() const {
  std::map<std::string, std::string> metadata = {{"architecture", hgn_architecture},
                                                 {"format_version", hgn_format_version}};
  fields(
      [&](auto member, const FieldInfo& info) { metadata[prefix + std::string(info.name)] = text_of(this->*member); });
  return metadata;
}

HgnConfig HgnConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  HgnConfig config;
  std::set<std::string> known;
  fields([&](auto member, const FieldInfo& info) {
    const std::string key = prefix + std::string(info.name);
    const std::string where = "'" + file + "': metadata key '" + key + "' ";
    known.insert(key);
    const auto found = metadata.find(key);
    if (found == metadata.end()) throw InputError(where + "is missing. Export the weights again");
    auto& value = config.*member;
    if (!parse(found->second, value))
      throw InputError(where + "is not " +
                       (std::is_same_v<std::decay_t<decltype(value)>, bool> ? "true or false" : "a number") + " ('" +
                       found->second + "'). Export the weights again");
    const auto number = static_cast<double>(value);
    if (!info.range.contains(number) || !std::isfinite(number))
      throw InputError(where + "is out of range ('" + found->second + "', allowed " + range_text(info.range) +
                       "). Export the weights again");
  });
  for (const auto& [key, value] : metadata)
    if (key.starts_with(prefix) && !known.contains(key))
      throw InputError("'" + file + "': metadata key '" + key + "' is not known ('" + value +
                       "'). The weights need a newer version of this program");
  return config;
}

}  // namespace graupel::graph
