// Config files in memory: overrides, places and the wording of errors.
#include "io/config/config_document.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/system/error.h"
#include "core/system/printable.h"

namespace graupel::io {

namespace {

/// Smallest number of insertions, deletions, replacements and swaps of neighbours (optimal string alignment).
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i)
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

std::vector<std::string> split(const std::string& path) {
  std::vector<std::string> keys;
  std::size_t start = 0;
  while (true) {
    const auto dot = path.find('.', start);
    keys.push_back(path.substr(start, dot - start));
    if (dot == std::string::npos) return keys;
    start = dot + 1;
  }
}

constexpr std::size_t shown_override = 120, shown_value = 60;  ///< bytes of them in messages

/// Whether an override's key names an item of a list.
bool is_item(const std::string& key) {
  return !key.empty() && std::all_of(key.begin(), key.end(), [](char c) { return c >= '0' && c <= '9'; });
}

JsonNode& list_item(JsonNode& list, const std::string& key, const std::string& where) {
  std::size_t index = 0;
  const auto result = std::from_chars(key.data(), key.data() + key.size(), index);
  if (result.ec == std::errc() && result.ptr == key.data() + key.size() && index < list.items.size())
    return list.items[index];
  const bool empty = list.items.empty();
  throw ConfigError(where + "there is no list item '" + shortened(key, shown_value) + "' (the list " +
                    (empty ? "is empty" : "has " + std::to_string(list.items.size()) + ", counted from 0") + "). " +
                    (empty ? "Give the whole list" : "Name one of them"));
}

/// What stands for a key that the text lacks while an override names something inside it.
JsonNode implied_value(const std::vector<std::string>& keys, std::size_t at, const std::string& text,
                       const DefaultLists& defaults) {
  const auto path_end = keys.begin() + static_cast<std::ptrdiff_t>(at) + 1;
  std::optional<JsonNode> list;
  if (defaults && path_end != keys.end() && is_item(*path_end)) list = defaults({keys.begin(), path_end});
  JsonNode made = list.value_or(JsonNode::object());
  mark_override(made, text);
  made.implied = !list;
  return made;
}

void apply_override(JsonNode& root, const std::string& text, const std::string& name, const DefaultLists& defaults) {
  const std::string where = name + " (override " + shortened(text, shown_override) + "): ";
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw ConfigError(where + "not an override. Write it as key.path=value, e.g. domain.dx=0.01");
  const std::vector<std::string> keys = split(text.substr(0, equals));
  JsonNode* node = &root;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string& key = keys[i];
    if (node->kind == JsonNode::Kind::array) {
      node = &list_item(*node, key, where);
    } else if (node->kind == JsonNode::Kind::object) {
      JsonNode* next = node->find(key);
      node = next ? next : &node->set(key, implied_value(keys, i, text, defaults));
    } else {
      throw ConfigError(where + "there is no '" + shortened(key, shown_value) + "' here (" +
                        shortened(write_json(*node, JsonLayout::compact), shown_value) +
                        " has no keys). Shorten the path");
    }
  }
  *node = override_value(text.substr(equals + 1), where);
  mark_override(*node, text);
}

}  // namespace

void mark_override(JsonNode& node, const std::string& text) {
  node.override_text = text;
  node.line = 0;
  for (auto& item : node.items) mark_override(item, text);
  for (auto& member : node.members) mark_override(member.value, text);
}

JsonNode override_value(const std::string& value, const std::string& where) {
  JsonNode node;
  try {
    node = parse_json(value, where);
  } catch (const Error& error) {
    if (!value.empty() && std::string_view("[{\"").find(value[0]) != std::string_view::npos)
      throw ConfigError(error.what());
    node = JsonNode::of(value);
  }
  return node;
}

ConfigDocument ConfigDocument::parse(const std::string& text, const std::string& name,
                                     const std::vector<std::string>& overrides, const DefaultLists& defaults) {
  ConfigDocument document{name, parse_json(text, name), nullptr};
  for (const auto& one : overrides) apply_override(document.root, one, name, defaults);
  return document;
}

ConfigPlace ConfigPlace::child(std::string_view key, const JsonNode& value) const {
  std::string escaped;
  for (const char c : shortened(key, shown_value)) {
    if (c == '~') {
      escaped += "~0";
    } else if (c == '/') {
      escaped += "~1";
    } else {
      escaped += c;
    }
  }
  return {document, pointer + "/" + escaped, value};
}

std::string ConfigPlace::text() const {
  const std::string where = pointer.empty() ? "the top level" : pointer;
  if (!node.override_text.empty())
    return document.name + " (override " + shortened(node.override_text, shown_override) + "): " + where;
  return document.name + ":" + std::to_string(node.line) + ": " + where;
}

std::string ConfigPlace::value() const { return shortened(write_json(node, JsonLayout::compact), shown_value); }

ConfigPlace find_place(const ConfigDocument& document, const std::vector<std::string>& keys) {
  std::string pointer;
  const JsonNode* node = &document.root;
  for (const auto& key : keys) {
    const JsonNode* next = nullptr;
    if (node->kind == JsonNode::Kind::array) {
      const std::size_t index = std::stoul(key);
      if (index < node->items.size()) next = &node->items[index];
    } else {
      next = node->find(key);
    }
    if (!next) break;
    pointer = ConfigPlace{document, pointer, *node}.child(std::string_view(key), *next).pointer;
    node = next;
  }
  return {document, pointer, *node};
}

void config_fail(const ConfigPlace& place, const std::string& problem, const std::string& remedy) {
  throw ConfigError(place.text() + " " + problem + ". " + remedy);
}

std::string did_you_mean(std::string_view word, const std::vector<std::string_view>& candidates) {
  const std::size_t limit = std::clamp<std::size_t>(word.size() / 3, 1, 3);
  std::size_t best = limit + 1;
  std::string_view closest;
  if (word.size() < 100)
    for (const auto candidate : candidates)
      if (const auto distance = edit_distance(word, candidate); distance < best) {
        best = distance;
        closest = candidate;
      }
  return best > limit ? "" : " Did you mean '" + std::string(closest) + "'?";
}

}  // namespace graupel::io
