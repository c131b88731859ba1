// Writes any struct that declares its fields as JSON that read_config reads back to the same struct.
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

}  // namespace graupel::io
