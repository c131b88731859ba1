// Type, range and key checks of config values.
#include "io/config/config_values.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/system/error.h"

namespace graupel::io {

namespace {

std::string joined(const std::vector<std::string_view>& words) {
  std::string text;
  for (const auto word : words) text += (text.empty() ? "" : ", ") + std::string(word);
  return text;
}

/// "domain.size", as overrides name a place.
std::string override_path(const ConfigPlace& place) {
  std::string path = place.pointer.substr(std::min<std::size_t>(1, place.pointer.size()));
  std::replace(path.begin(), path.end(), '/', '.');
  return path;
}

[[noreturn]] void wrong_type(const ConfigPlace& place, const std::string& wanted, const std::string& remedy) {
  if (place.node.implied)
    config_fail(place, "is not given, so that nothing inside it can be set (it must be " + wanted + ")",
                "Set all of it: " + override_path(place) + "=VALUE");
  config_fail(place, "must be " + wanted + " (" + place.value() + ")", remedy);
}

[[noreturn]] void out_of_range(const ConfigPlace& place, const std::string& allowed) {
  config_fail(place, "is out of range (" + place.value() + ", allowed " + allowed + ")", "Change the value");
}

constexpr double exact_limit = 9007199254740992.0;  // 2^53: whole numbers written like 3e2 are exact up to here

/// Whole numbers may be written as 300 or 3e2.
bool is_whole(const JsonNode& node) {
  if (node.kind == JsonNode::Kind::integer) return true;
  return node.kind == JsonNode::Kind::real && std::floor(node.real) == node.real;
}

std::string integer_range(const Range& range) {
  const std::string text = range_text(range);
  return text.empty() ? "whole numbers of 64 bits" : text;
}

}  // namespace

bool read_boolean(const ConfigPlace& place) {
  if (place.node.kind != JsonNode::Kind::boolean) wrong_type(place, "true or false", "Write true or false");
  return place.node.boolean;
}

int64_t read_integer(const ConfigPlace& place, const Range& range) {
  const JsonNode& node = place.node;
  if (!is_whole(node)) wrong_type(place, "a whole number", "Write a number without a fraction");
  if (!range.contains(node.as_double())) out_of_range(place, integer_range(range));
  if (node.kind == JsonNode::Kind::real) {
    if (std::abs(node.real) > exact_limit) out_of_range(place, integer_range(range));
    return static_cast<int64_t>(node.real);
  }
  const uint64_t limit = uint64_t(1) << 63;
  if (node.magnitude > limit - (node.negative ? 0 : 1)) out_of_range(place, integer_range(range));
  return static_cast<int64_t>(node.negative ? uint64_t(0) - node.magnitude : node.magnitude);
}

uint64_t read_natural(const ConfigPlace& place, const Range& range) {
  const JsonNode& node = place.node;
  if (!is_whole(node)) wrong_type(place, "a whole number", "Write a number without a fraction");
  const double value = node.as_double();
  if (value < 0 || !range.contains(value) || (node.kind == JsonNode::Kind::real && value > exact_limit))
    out_of_range(place, ">= 0, up to 2^64 - 1");
  return node.kind == JsonNode::Kind::real ? static_cast<uint64_t>(node.real) : node.magnitude;
}

double read_number(const ConfigPlace& place, const Range& range) {
  if (!place.node.is_number()) wrong_type(place, "a number", "Write a number without quotes and unit");
  const double value = place.node.as_double();
  if (!std::isfinite(value) || !range.contains(value)) out_of_range(place, range_text(range));
  return value;
}

std::string read_string(const ConfigPlace& place) {
  if (place.node.kind != JsonNode::Kind::string) wrong_type(place, "text", "Put it in quotes");
  if (place.node.text.find('\0') != std::string::npos)
    config_fail(place, "holds the character NUL (\\u0000)", "Take it out");
  return place.node.text;
}

void read_numbers(const ConfigPlace& place, const Range& range, double* out, std::size_t count) {
  const auto& items = place.node.items;
  if (place.node.kind != JsonNode::Kind::array || items.size() != count)
    wrong_type(place, "a list of " + std::to_string(count) + " numbers", "Write it like [0, 1, 0]");
  for (std::size_t i = 0; i < count; ++i) out[i] = read_number(place.child(i, items[i]), range);
}

const std::vector<JsonNode>& read_interval_ends(const ConfigPlace& place) {
  const auto& items = place.node.items;
  if (place.node.kind != JsonNode::Kind::array || items.size() != 2)
    wrong_type(place, "an interval of 2 numbers", "Write it like [0.1, 0.7]");
  return items;
}

void interval_out_of_order(const ConfigPlace& place) {
  config_fail(place, "has its upper end below the lower one (" + place.value() + ", allowed [low, high], low <= high)",
              "Swap them");
}

std::size_t read_word(const ConfigPlace& place, const std::vector<std::string_view>& words, std::string_view offered) {
  const std::string word = read_string(place);
  const auto found = std::find(words.begin(), words.end(), word);
  if (found == words.end()) {
    const auto named = offered.empty() ? words : words_of_list(offered);
    config_fail(place, "is not one of its words (" + place.value() + ", allowed: " + joined(named) + ")",
                "Use one of them." + did_you_mean(word, named));
  }
  return static_cast<std::size_t>(found - words.begin());
}

const std::vector<JsonNode>& read_list(const ConfigPlace& place) {
  if (place.node.kind != JsonNode::Kind::array) wrong_type(place, "a list", "Write it in [ ]");
  return place.node.items;
}

const std::vector<JsonMember>& read_members(const ConfigPlace& place) {
  if (place.node.kind != JsonNode::Kind::object) wrong_type(place, "an object", "Write it in { }");
  return place.node.members;
}

namespace {

/// Whether the key is a removed one; throws where its value asks for what has gone.
bool is_removed(const ConfigPlace& place, std::string_view key, const std::vector<RemovedField>& removed) {
  for (const RemovedField& field : removed) {
    if (field.name != key) continue;
    const auto accepted = accepted_forms(field);
    if (std::find(accepted.begin(), accepted.end(), write_json(place.node, JsonLayout::compact)) == accepted.end())
      config_fail(place, removed_text(field, place.value()), "Leave it out");
    return true;
  }
  return false;
}

}  // namespace

void check_keys(const ConfigPlace& place, const std::vector<std::string_view>& fields,
                const std::vector<RemovedField>& removed) {
  for (const auto& member : read_members(place)) {
    if (place.pointer.empty() && member.key == "$schema") continue;
    if (is_removed(place.child(member.key, member.value), member.key, removed)) continue;
    if (std::find(fields.begin(), fields.end(), member.key) == fields.end())
      place.document.attempt([&] {
        config_fail(place.child(member.key, member.value), "is not a known key (known here: " + joined(fields) + ")",
                    "Remove or correct it." + did_you_mean(member.key, fields));
      });
  }
}

const JsonNode* check_field(const ConfigPlace& place, const FieldInfo& info, const std::vector<KindField>& kinds) {
  const JsonNode* node = place.node.find(info.name);
  if (!applies(info, kinds)) {
    if (!node) return nullptr;
    const KindField& kind = kind_of(info, kinds);
    config_fail(place.child(info.name, *node),
                "does not apply here (" + std::string(kind.name) + " is '" + std::string(kind.current) +
                    "'; the key is for: " + joined(words_of_list(info.only_for)) + ")",
                "Remove the key or change '" + std::string(kind.name) + "'");
  }
  if (!node && info.required)
    config_fail(place, "lacks the key '" + std::string(info.name) + "' (" + std::string(info.meaning) + ")", "Add it");
  return node;
}

void check_entry(const ConfigPlace& map, const std::string& key, const ConfigPlace& entry) {
  if (!entry.node.implied) return;
  std::vector<std::string_view> known;
  for (const auto& member : map.node.members)
    if (!member.value.implied) known.push_back(member.key);
  config_fail(entry, "does not exist (there are: " + joined(known) + ")",
              "An override changes existing entries or sets whole ones." + did_you_mean(key, known));
}

}  // namespace graupel::io
