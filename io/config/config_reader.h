// Reads any struct that declares its fields (core/scene/fields.h) from a config document, JSON with comments. Unknown
// keys, keys of another kind, missing keys, wrong types and values out of range throw ConfigError. An enum field must
// be declared before the fields whose `only_for` names its words.
#pragma once

#include <concepts>
#include <map>
#include <optional>
#include <type_traits>

#include "core/scene/interval.h"
#include "core/system/any_value.h"
#include "io/config/config_values.h"

namespace graupel::io {

/// Specialise to prepare a struct before its keys are read: `key` is its name in a map, or "".
template <typename T>
struct ConfigStart {
  static void begin(const ConfigPlace&, const std::string& /*key*/, T&) {}
};

template <typename T>
std::vector<std::string_view> field_names() {
  std::vector<std::string_view> names;
  T::fields([&](auto, const FieldInfo& info) { names.push_back(info.name); });
  return names;
}

template <typename T>
struct IsInterval : std::false_type {};
template <typename T>
struct IsInterval<IntervalOf<T>> : std::true_type {};
template <typename T>
struct IsVector : std::false_type {};
template <typename T>
struct IsVector<std::vector<T>> : std::true_type {};
template <typename T>
struct IsMap : std::false_type {};
template <typename T>
struct IsMap<std::map<std::string, T>> : std::true_type {};
template <typename T>
struct IsOptional : std::false_type {};
template <typename T>
struct IsOptional<std::optional<T>> : std::true_type {};

template <ConfigStruct T>
void read_struct(const ConfigPlace& place, const std::string& key, T& out);

template <typename T>
void read_value(const ConfigPlace& place, const FieldInfo& info, T& out) {
  if constexpr (std::is_same_v<T, bool>) {
    out = read_boolean(place);
  } else if constexpr (std::is_same_v<T, int64_t>) {
    out = read_integer(place, info.range);
  } else if constexpr (std::is_same_v<T, uint64_t>) {
    out = read_natural(place, info.range);
  } else if constexpr (std::is_same_v<T, double>) {
    out = read_number(place, info.range);
  } else if constexpr (std::is_same_v<T, std::string>) {
    out = read_string(place);
  } else if constexpr (std::is_same_v<T, AnyValue>) {
    out.json = write_json(place.node, JsonLayout::compact);
  } else if constexpr (std::is_same_v<T, Vec3d>) {
    read_numbers(place, info.range, out.a, 3);
  } else if constexpr (IsInterval<T>::value) {
    const auto& ends = read_interval_ends(place);
    read_value(place.child(0, ends[0]), info, out.low);
    read_value(place.child(1, ends[1]), info, out.high);
    if (out.low > out.high) interval_out_of_order(place);
  } else if constexpr (ConfigEnum<T>) {
    out = EnumWords<T>::words[read_word(place, enum_words<T>(), info.offered)].second;
  } else if constexpr (IsOptional<T>::value) {
    read_value(place, info, out.emplace());
  } else if constexpr (IsVector<T>::value) {
    out.clear();
    const auto& items = read_list(place);
    for (std::size_t i = 0; i < items.size(); ++i) read_value(place.child(i, items[i]), info, out.emplace_back());
  } else if constexpr (IsMap<T>::value) {
    out.clear();
    for (const auto& member : read_members(place)) {
      const ConfigPlace entry = place.child(member.key, member.value);
      check_entry(place, member.key, entry);
      if constexpr (ConfigStruct<typename T::mapped_type>) {
        read_struct(entry, member.key, out[member.key]);
      } else {
        read_value(entry, info, out[member.key]);
      }
    }
  } else {
    static_assert(ConfigStruct<T>, "a config field of a type that core/scene/fields.h does not list");
    read_struct(place, "", out);
  }
}

template <ConfigStruct T>
void read_struct(const ConfigPlace& place, const std::string& key, T& out) {
  check_keys(place, field_names<T>(), removed_fields<T>());
  if (!place.document.attempt([&] { ConfigStart<T>::begin(place, key, out); })) return;
  std::vector<KindField> kinds;
  bool kinds_known = true;  // a mistake in a kind is reported alone, without those that follow from it
  T::fields([&](auto member, const FieldInfo& info) {
    using Field = std::remove_reference_t<decltype(out.*member)>;
    if (!kinds_known && !info.only_for.empty()) return;
    const bool read = place.document.attempt([&] {
      if (const JsonNode* node = check_field(place, info, kinds))
        read_value(place.child(info.name, *node), info, out.*member);
    });
    if constexpr (ConfigEnum<Field>) {
      kinds.push_back({info.name, enum_words<Field>(), word_of(out.*member)});
      kinds_known = kinds_known && read;
    }
  });
}

/// The document as a T; absent keys keep T's defaults.
template <ConfigStruct T>
T read_config(const ConfigDocument& document) {
  T out;
  read_struct(ConfigPlace{document, "", document.root}, "", out);
  return out;
}

}  // namespace graupel::io
