// Writes any struct that declares its fields as JSON that read_config reads back to the same struct, and reads it from
// text with overrides, which know its defaults:
//
//   Recipe recipe = io::read_config<Recipe>(text, "recipe.json", {"train.steps=100"});
#pragma once

#include "io/config/config_reader.h"

namespace graupel::io {

template <ConfigStruct T>
JsonNode json_of_struct(const T& value);

template <typename T>
JsonNode json_of(const T& value) {
  if constexpr (std::is_same_v<T, AnyValue>) {
    return parse_json(value.json, "value");
  } else if constexpr (std::is_same_v<T, Vec3d>) {
    JsonNode list = JsonNode::array();
    for (int i = 0; i < 3; ++i) list.items.push_back(JsonNode::of(value[i]));
    return list;
  } else if constexpr (IsInterval<T>::value) {
    JsonNode ends = JsonNode::array();
    ends.items = {JsonNode::of(value.low), JsonNode::of(value.high)};
    return ends;
  } else if constexpr (ConfigEnum<T>) {
    return JsonNode::of(word_of(value));
  } else if constexpr (IsOptional<T>::value) {
    return value ? json_of(*value) : JsonNode();
  } else if constexpr (IsVector<T>::value) {
    JsonNode list = JsonNode::array();
    for (const auto& item : value) list.items.push_back(json_of(item));
    return list;
  } else if constexpr (IsMap<T>::value) {
    JsonNode object = JsonNode::object();
    for (const auto& [key, item] : value) object.set(key, json_of(item));
    return object;
  } else if constexpr (ConfigStruct<T>) {
    return json_of_struct(value);
  } else {
    return JsonNode::of(value);
  }
}

/// Every field that applies to the struct's kind; empty optionals are left out.
template <ConfigStruct T>
JsonNode json_of_struct(const T& value) {
  JsonNode object = JsonNode::object();
  std::vector<KindField> kinds;
  T::fields([&](auto member, const FieldInfo& info) {
    using Field = std::remove_cvref_t<decltype(value.*member)>;
    const bool wanted = applies(info, kinds);
    JsonNode node = json_of(value.*member);
    if (wanted && node.kind != JsonNode::Kind::null) object.set(std::string(info.name), std::move(node));
    if constexpr (ConfigEnum<Field>) kinds.push_back({info.name, enum_words<Field>(), word_of(value.*member)});
  });
  return object;
}

/// The list at `path` inside `value`; none where something else is there, and for numbers that a text must give. Lists
/// and maps of structs have items as a new struct is.
template <typename T>
std::optional<JsonNode> default_list(const T& value, const std::vector<std::string>& path, std::size_t begin = 0) {
  std::optional<JsonNode> found;
  const bool is_end = begin == path.size();
  if constexpr (IsOptional<T>::value) {
    if (value) found = default_list(*value, path, begin);
    if (!value && !is_end && ConfigStruct<typename T::value_type>)
      found = default_list(typename T::value_type(), path, begin);
  } else if constexpr (ConfigStruct<T>) {
    if (!is_end)
      T::fields([&](auto member, const FieldInfo& info) {
        if (info.name != path[begin]) return;
        found = default_list(value.*member, path, begin + 1);
        if (info.required && begin + 1 == path.size() && found && !found->items.empty()) found.reset();
      });
  } else if constexpr (IsMap<T>::value) {
    if (!is_end) found = default_list(typename T::mapped_type(), path, begin + 1);
  } else if constexpr (IsVector<T>::value) {
    found = is_end ? json_of(value) : default_list(typename T::value_type(), path, begin + 1);
  } else if constexpr (std::is_same_v<T, Vec3d> || IsInterval<T>::value) {
    if (is_end) found = json_of(value);
  }
  return found;
}

/// The text with overrides, of which those of an item of a list change T's default where the text lacks the list.
template <ConfigStruct T>
ConfigDocument parse_document(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides = {}) {
  return ConfigDocument::parse(text, name, overrides,
                               [](const std::vector<std::string>& path) { return default_list(T(), path); });
}

/// A T from text; `name` stands for the file in messages, `overrides` are "key.path=value".
template <ConfigStruct T>
T read_config(const std::string& text, const std::string& name, const std::vector<std::string>& overrides = {}) {
  return read_config<T>(parse_document<T>(text, name, overrides));
}

}  // namespace graupel::io
