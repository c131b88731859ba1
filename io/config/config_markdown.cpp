// Config descriptions as Markdown tables and as commented JSON.
#include <algorithm>
#include <map>

#include "io/config/config_description.h"

namespace graupel::io {

namespace {

std::string joined(const std::vector<std::string_view>& words, const std::string& separator) {
  std::string text;
  for (const auto word : words) text += (text.empty() ? "" : separator) + std::string(word);
  return text;
}

std::string type_text(const FieldDescription& field) {
  std::string one;
  switch (field.type) {
    case FieldType::boolean:
      one = "true or false";
      break;
    case FieldType::integer:
    case FieldType::natural:
      one = "whole number";
      break;
    case FieldType::number:
      one = "number";
      break;
    case FieldType::text:
      one = "text";
      break;
    case FieldType::vector3:
      one = "[x, y, z]";
      break;
    case FieldType::interval:
      one = "interval";
      break;
    case FieldType::whole_interval:
      one = "whole interval";
      break;
    case FieldType::word:
      one = "word";
      break;
    case FieldType::any:
      one = "value";
      break;
    case FieldType::structure:
      one = "object";
  }
  if (field.shape == FieldShape::list) return "list of " + one + "s";
  if (field.shape == FieldShape::map) return one + "s by name";
  return one;
}

std::string allowed_text(const FieldDescription& field) {
  if (field.type == FieldType::word) return joined(field.words, ", ");
  return range_text(field.info.range);
}

std::string default_text(const FieldDescription& field) {
  if (field.info.required) return "required";
  if (field.optional) return "";
  if (field.type == FieldType::structure && field.shape == FieldShape::single) return "";
  return "`" + write_json(field.default_value, JsonLayout::compact) + "`";
}

/// The kinds that the field is for, of those that the struct may have.
std::string only_for_text(const FieldDescription& field, const StructDescription& all) {
  if (field.kind_field.empty()) return "";
  const auto kind = std::find_if(all.fields.begin(), all.fields.end(),
                                 [&](const FieldDescription& other) { return other.info.name == field.kind_field; });
  std::vector<std::string_view> words = words_of_list(field.info.only_for);
  std::erase_if(words, [&](std::string_view word) {
    return std::find(kind->words.begin(), kind->words.end(), word) == kind->words.end();
  });
  return field.kind_field + ": " + joined(words, ", ");
}

/// One table a struct; one that stands there already is named instead of written again.
void write_tables(const StructDescription& description, const std::string& title, std::string& out,
                  std::map<std::string, std::string>& title_of_table) {
  std::string table = "| Key | Type | Unit | Default | Allowed | Only for | Meaning |\n|---|---|---|---|---|---|---|\n";
  for (const auto& field : description.fields)
    table += "| `" + std::string(field.info.name) + "` | " + type_text(field) + " | " + std::string(field.info.unit) +
             " | " + default_text(field) + " | " + allowed_text(field) + " | " + only_for_text(field, description) +
             " | " + std::string(field.info.meaning) + " |\n";
  const auto [known, is_new] = title_of_table.try_emplace(table, title);
  if (!is_new) {
    if (known->second != title) out += "\n## " + title + "\n\nAs " + known->second + ".\n";
    return;
  }
  out += "\n## " + title + "\n\n" + table;
  for (const auto& field : description.fields) {
    if (!field.structure) continue;
    const char* suffix = field.shape == FieldShape::list ? "[]" : field.shape == FieldShape::map ? ".<name>" : "";
    write_tables(*field.structure, "`" + std::string(field.info.name) + suffix + "`", out, title_of_table);
  }
}

std::string comment_text(const FieldDescription& field, const StructDescription& all) {
  std::string text(field.info.meaning);
  if (!field.info.unit.empty()) text += " [" + std::string(field.info.unit) + "]";
  if (const std::string allowed = allowed_text(field); !allowed.empty()) text += "; " + allowed;
  if (!field.kind_field.empty()) text += "; only for " + only_for_text(field, all);
  return text;
}

JsonNode with_comments(const StructDescription& description, const JsonNode& value) {
  JsonNode out = JsonNode::object();
  for (const auto& field : description.fields) {
    const JsonNode* present = value.find(field.info.name);
    JsonNode node = present ? *present : field.default_value;
    node.commented_out = !present;
    if (present && field.structure) {
      if (field.shape == FieldShape::single) node = with_comments(*field.structure, node);
      for (auto& item : node.items) item = with_comments(*field.structure, item);
      if (field.shape == FieldShape::map)
        for (auto& member : node.members) member.value = with_comments(*field.structure, member.value);
    }
    node.comment = comment_text(field, description);
    const bool several_lines = !node.members.empty();
    if (present || !several_lines) out.set(std::string(field.info.name), std::move(node));
  }
  return out;
}

}  // namespace

std::string description_markdown(const StructDescription& description, const std::string& title) {
  std::string out;
  std::map<std::string, std::string> title_of_table;
  write_tables(description, title, out, title_of_table);
  return out;
}

std::string commented_json(const StructDescription& description, JsonNode value) {
  return write_json(with_comments(description, value), JsonLayout::indented);
}

}  // namespace graupel::io
