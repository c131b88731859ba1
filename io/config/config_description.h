// A config struct's declaration as data, and what is made of it: the format's documentation, the JSON schema for
// editors, and the file with every default.
#pragma once

#include <memory>

#include "io/config/config_writer.h"

namespace graupel::io {

struct StructDescription;

/// How a field holds its type.
enum class FieldShape { single, list, map };
enum class FieldType {
  boolean,
  integer,
  natural,
  number,
  text,
  vector3,
  interval,
  whole_interval,
  word,
  any,
  structure
};

struct FieldDescription {
  FieldInfo info;
  FieldType type = FieldType::text;
  FieldShape shape = FieldShape::single;
  bool optional = false;
  std::vector<std::string_view> words;           ///< of FieldType::word; of FieldType::text where it takes no others
  std::shared_ptr<StructDescription> structure;  ///< of FieldType::structure
  std::string kind_field;                        ///< the field that info.only_for speaks of
  JsonNode default_value;
};

struct StructDescription {
  std::vector<FieldDescription> fields;
};

template <ConfigStruct T>
StructDescription describe();

template <typename T>
void describe_type(FieldDescription& field) {
  if constexpr (IsOptional<T>::value) {
    field.optional = true;
    describe_type<typename T::value_type>(field);
  } else if constexpr (IsVector<T>::value) {
    field.shape = FieldShape::list;
    describe_type<typename T::value_type>(field);
  } else if constexpr (IsMap<T>::value) {
    field.shape = FieldShape::map;
    describe_type<typename T::mapped_type>(field);
  } else if constexpr (ConfigEnum<T>) {
    field.type = FieldType::word;
    field.words = enum_words<T>();
  } else if constexpr (ConfigStruct<T>) {
    field.type = FieldType::structure;
    field.structure = std::make_shared<StructDescription>(describe<T>());
  } else if constexpr (std::is_same_v<T, AnyValue>) {
    field.type = FieldType::any;
  } else {
    field.type = std::is_same_v<T, bool>            ? FieldType::boolean
                 : std::is_same_v<T, int64_t>       ? FieldType::integer
                 : std::is_same_v<T, uint64_t>      ? FieldType::natural
                 : std::is_same_v<T, double>        ? FieldType::number
                 : std::is_same_v<T, Vec3d>         ? FieldType::vector3
                 : std::is_same_v<T, Interval>      ? FieldType::interval
                 : std::is_same_v<T, WholeInterval> ? FieldType::whole_interval
                                                    : FieldType::text;
  }
}

template <ConfigStruct T>
StructDescription describe() {
  const T defaults{};
  StructDescription all;
  std::vector<KindField> kinds;
  T::fields([&](auto member, const FieldInfo& info) {
    using Field = std::remove_cvref_t<decltype(defaults.*member)>;
    FieldDescription field{.info = info, .words = {}, .structure = {}, .kind_field = {}, .default_value = {}};
    describe_type<Field>(field);
    if (!info.offered.empty()) field.words = words_of_list(info.offered);
    if (!info.only_for.empty()) field.kind_field = kind_of(info, kinds).name;
    field.default_value = json_of(defaults.*member);
    if constexpr (ConfigEnum<Field>) kinds.push_back({info.name, field.words, word_of(defaults.*member)});
    all.fields.push_back(std::move(field));
  });
  return all;
}

/// Markdown tables, one a struct, headed by the struct's place in the file ("sources[]").
std::string description_markdown(const StructDescription& description, const std::string& title);
/// JSON schema (draft 2020-12) that refuses unknown keys.
std::string description_schema(const StructDescription& description, const std::string& title);
/// `value` (as json_of gives it) as commented JSON with every field; those that `value` lacks are written as comments
/// with their defaults. Reads back to the same value.
std::string commented_json(const StructDescription& description, JsonNode value);

}  // namespace graupel::io
