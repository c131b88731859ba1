// A network's hyper-parameters as metadata of its weights file: "<prefix>latent" = "128" .., one key for each declared
// field (core/scene/fields.h), beside "architecture" and "format_version".
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/scene/fields.h"
#include "core/scene/removed_field.h"
#include "core/system/error.h"
#include "nn/weights.h"

namespace graupel::graph {

using Metadata = std::map<std::string, std::string>;

namespace metadata {

template <typename T>
std::string text_of(T value) {
  if constexpr (std::is_same_v<T, bool>) {
    return value ? "true" : "false";
  } else if constexpr (std::is_enum_v<T>) {
    return word_of(value);
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
  } else if constexpr (std::is_enum_v<T>) {
    for (const auto& [word, meant] : EnumWords<T>::words) {
      if (text != word) continue;
      value = meant;
      return true;
    }
    return false;
  } else {
    const char* end = text.data() + text.size();
    const auto [stop, status] = std::from_chars(text.data(), end, value);
    return status == std::errc() && stop == end;
  }
}

/// What a value of this type must be: "a number", "one of messages, activations".
template <typename T>
std::string kind_of() {
  if constexpr (std::is_same_v<T, bool>) {
    return "true or false";
  } else if constexpr (std::is_enum_v<T>) {
    std::string words;
    for (const auto& [word, meant] : EnumWords<T>::words) words.append(words.empty() ? "one of " : ", ").append(word);
    return words;
  } else {
    return "a number";
  }
}

std::string range_text(const Range& range);
/// "latent" -> "hgn.latent".
std::string key_of(const std::string& prefix, const FieldInfo& info);
/// "'file': metadata key 'key' ".
std::string where(const std::string& file, const std::string& key);
/// RemovedField::accepted as metadata has it: words without quotes.
std::vector<std::string> metadata_forms(const RemovedField& field);
/// Throws InputError unless the value of a removed key is one of them.
void check_removed(const RemovedField& field, const std::string& value, const std::string& where);

}  // namespace metadata

template <typename Config>
Metadata metadata_of(const Config& config, const std::string& prefix, const char* architecture, const char* version) {
  Metadata all = {{"architecture", architecture}, {"format_version", version}};
  Config::fields([&](auto member, const FieldInfo& info) {
    all[metadata::key_of(prefix, info)] = metadata::text_of(config.*member);
  });
  // Programs from before a key was removed read it.
  for (const RemovedField& field : removed_fields<Config>())
    all[prefix + std::string(field.name)] = metadata::metadata_forms(field).front();
  return all;
}

/// Throws InputError naming `file`, key and value when a key is missing, unknown, unreadable, out of range, or removed
/// and not switched off. The fields named in `newer` came after the first files: without their key they keep the
/// default.
template <typename Config>
Config config_from(const Metadata& all, const std::string& prefix, const std::string& file,
                   std::initializer_list<std::string_view> newer = {}) {
  Config config;
  std::set<std::string> known;
  Config::fields([&](auto member, const FieldInfo& info) {
    const std::string key = metadata::key_of(prefix, info);
    const std::string where = metadata::where(file, key);
    known.insert(key);
    const auto found = all.find(key);
    if (found == all.end()) {
      if (std::find(newer.begin(), newer.end(), info.name) != newer.end()) return;
      throw InputError(where + "is missing. Export the weights again");
    }
    auto& value = config.*member;
    if (!metadata::parse(found->second, value))
      throw InputError(where + "is not " + metadata::kind_of<std::decay_t<decltype(value)>>() + " ('" + found->second +
                       "'). Export the weights again");
    const auto number = static_cast<double>(value);
    if (!info.range.contains(number) || !std::isfinite(number))
      throw InputError(where + "is out of range ('" + found->second + "', allowed " + metadata::range_text(info.range) +
                       "). Export the weights again");
  });
  for (const RemovedField& field : removed_fields<Config>()) {
    const std::string key = prefix + std::string(field.name);
    known.insert(key);
    if (const auto found = all.find(key); found != all.end())
      metadata::check_removed(field, found->second, metadata::where(file, key));
  }
  for (const auto& [key, value] : all)
    if (key.starts_with(prefix) && !known.contains(key))
      throw InputError(metadata::where(file, key) + "is not known ('" + value +
                       "'). The weights need a newer version of this program");
  return config;
}

}  // namespace graupel::graph
