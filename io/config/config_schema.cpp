// Config descriptions as JSON schema, draft 2020-12 (https://json-schema.org/draft/2020-12).
#include <algorithm>
#include <cmath>

#include "io/config/config_description.h"

namespace graupel::io {

namespace {

JsonNode struct_schema(const StructDescription& description);

JsonNode word_list(const std::vector<std::string_view>& words) {
  JsonNode list = JsonNode::array();
  for (const auto word : words) list.items.push_back(JsonNode::of(std::string(word)));
  return list;
}

void add_range(JsonNode& schema, const Range& range) {
  if (std::isfinite(range.low)) schema.set(range.low_open ? "exclusiveMinimum" : "minimum", JsonNode::of(range.low));
  if (std::isfinite(range.high)) schema.set(range.high_open ? "exclusiveMaximum" : "maximum", JsonNode::of(range.high));
}

JsonNode typed(const char* type) {
  JsonNode schema = JsonNode::object();
  schema.set("type", JsonNode::of(type));
  return schema;
}

JsonNode number_schema(const char* type, const Range& range) {
  JsonNode schema = typed(type);
  add_range(schema, range);
  return schema;
}

JsonNode numbers_schema(const char* type, int64_t count, const Range& range) {
  JsonNode schema = typed("array");
  schema.set("items", number_schema(type, range));
  schema.set("minItems", JsonNode::of(count));
  schema.set("maxItems", JsonNode::of(count));
  return schema;
}

JsonNode single_schema(const FieldDescription& field) {
  switch (field.type) {
    case FieldType::boolean:
      return typed("boolean");
    case FieldType::integer:
      return number_schema("integer", field.info.range);
    case FieldType::natural: {
      Range range = field.info.range;
      range.low = std::max(range.low, 0.0);
      return number_schema("integer", range);
    }
    case FieldType::number:
      return number_schema("number", field.info.range);
    case FieldType::text: {
      JsonNode schema = typed("string");
      if (!field.words.empty()) schema.set("enum", word_list(field.words)).items.push_back(field.default_value);
      return schema;
    }
    case FieldType::vector3:
      return numbers_schema("number", 3, field.info.range);
    case FieldType::interval:
      return numbers_schema("number", 2, field.info.range);
    case FieldType::whole_interval:
      return numbers_schema("integer", 2, field.info.range);
    case FieldType::word: {
      JsonNode schema = JsonNode::object();
      schema.set("enum", word_list(field.words));
      return schema;
    }
    case FieldType::any:
      return JsonNode::object();
    case FieldType::structure:
      return struct_schema(*field.structure);
  }
  return JsonNode::object();
}

JsonNode field_schema(const FieldDescription& field) {
  JsonNode schema = single_schema(field);
  if (field.shape == FieldShape::list) {
    JsonNode list = typed("array");
    list.set("items", std::move(schema));
    schema = std::move(list);
  } else if (field.shape == FieldShape::map) {
    JsonNode map = typed("object");
    map.set("additionalProperties", std::move(schema));
    schema = std::move(map);
  }
  std::string text(field.info.meaning);
  if (!field.info.unit.empty()) text += " [" + std::string(field.info.unit) + "]";
  schema.set("description", JsonNode::of(text));
  const bool leaf = field.type != FieldType::structure;
  if (leaf && !field.info.required && !field.optional) schema.set("default", field.default_value);
  return schema;
}

/// if the kind field has this word, then these keys are required and those are refused.
JsonNode rule_for_word(const StructDescription& description, const FieldDescription& kind, std::string_view word) {
  JsonNode required = JsonNode::array();
  JsonNode refused = JsonNode::object();
  for (const auto& field : description.fields) {
    if (field.kind_field != kind.info.name) continue;
    const auto only = words_of_list(field.info.only_for);
    if (std::find(only.begin(), only.end(), word) == only.end()) {
      refused.set(std::string(field.info.name), JsonNode::of(false));
    } else if (field.info.required) {
      required.items.push_back(JsonNode::of(std::string(field.info.name)));
    }
  }
  JsonNode is_word = JsonNode::object();
  is_word.set(std::string(kind.info.name), JsonNode::object()).set("const", JsonNode::of(std::string(word)));
  JsonNode condition = JsonNode::object();
  condition.set("properties", std::move(is_word));
  condition.set("required", word_list({kind.info.name}));
  JsonNode then = JsonNode::object();
  if (!required.items.empty()) then.set("required", std::move(required));
  if (!refused.members.empty()) then.set("properties", std::move(refused));
  JsonNode rule = JsonNode::object();
  rule.set("if", std::move(condition));
  rule.set("then", std::move(then));
  return rule;
}

JsonNode kind_rules(const StructDescription& description) {
  JsonNode rules = JsonNode::array();
  for (const auto& kind : description.fields) {
    const bool used = std::any_of(description.fields.begin(), description.fields.end(),
                                  [&](const auto& field) { return field.kind_field == kind.info.name; });
    if (!used) continue;
    for (const auto word : kind.words) rules.items.push_back(rule_for_word(description, kind, word));
  }
  return rules;
}

JsonNode struct_schema(const StructDescription& description) {
  JsonNode schema = typed("object");
  JsonNode properties = JsonNode::object();
  JsonNode required = JsonNode::array();
  for (const auto& field : description.fields) {
    properties.set(std::string(field.info.name), field_schema(field));
    if (field.info.required && field.info.only_for.empty())
      required.items.push_back(JsonNode::of(std::string(field.info.name)));
  }
  schema.set("properties", std::move(properties));
  schema.set("additionalProperties", JsonNode::of(false));
  if (!required.items.empty()) schema.set("required", std::move(required));
  if (JsonNode rules = kind_rules(description); !rules.items.empty()) schema.set("allOf", std::move(rules));
  return schema;
}

}  // namespace

std::string description_schema(const StructDescription& description, const std::string& title) {
  JsonNode schema = JsonNode::object();
  schema.set("$schema", JsonNode::of("https://json-schema.org/draft/2020-12/schema"));
  schema.set("title", JsonNode::of(title));
  JsonNode body = struct_schema(description);
  for (auto& member : body.members) schema.set(member.key, std::move(member.value));
  schema.find("properties")->set("$schema", typed("string"));
  return write_json(schema, JsonLayout::indented);
}

}  // namespace graupel::io
