// Writes JSON, compact or indented, with the comments that nodes carry.
#include <charconv>
#include <cstdio>

#include "core/system/error.h"
#include "io/config/json_node.h"

namespace graupel::io {

namespace {

std::string quoted(const std::string& text) {
  std::string out(1, '"');
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (c == '\n') {
      out += "\\n";
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned>(c));
      out += escape;
    } else {
      out += c;
    }
  }
  out += '"';
  return out;
}

std::string number(const JsonNode& node) {
  if (node.kind == JsonNode::Kind::integer) {
    std::string digits = std::to_string(node.magnitude);
    if (node.negative) digits.insert(digits.begin(), '-');
    return digits;
  }
  char digits[40];
  const auto result = std::to_chars(digits, digits + sizeof digits, node.real);
  std::string text(digits, result.ptr);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";  // stays a real number, and -0 keeps its sign
  return text;
}

std::string scalar(const JsonNode& node) {
  switch (node.kind) {
    case JsonNode::Kind::null:
      return "null";
    case JsonNode::Kind::boolean:
      return node.boolean ? "true" : "false";
    case JsonNode::Kind::integer:
    case JsonNode::Kind::real:
      return number(node);
    default:
      return quoted(node.text);
  }
}

bool is_container(const JsonNode& node) {
  return node.kind == JsonNode::Kind::array || node.kind == JsonNode::Kind::object;
}

void write_compact(const JsonNode& node, std::string& out) {
  const bool object = node.kind == JsonNode::Kind::object;
  if (!is_container(node)) {
    out += scalar(node);
    return;
  }
  out += object ? '{' : '[';
  const char* separator = "";
  for (const auto& item : node.items) {
    out += separator;
    write_compact(item, out);
    separator = ",";
  }
  for (const auto& member : node.members) {
    out += separator;
    out += quoted(member.key);
    out += ':';
    write_compact(member.value, out);
    separator = ",";
  }
  out += object ? '}' : ']';
}

/// Arrays of scalars and empty containers stay on one line.
bool fits_one_line(const JsonNode& node) {
  if (!node.members.empty()) return false;
  for (const auto& item : node.items)
    if (is_container(item)) return false;
  return true;
}

std::string one_line(const JsonNode& node) {
  if (!is_container(node)) return scalar(node);
  if (node.kind == JsonNode::Kind::object) return "{}";
  std::string out = "[";
  for (const auto& item : node.items) {
    if (out.size() > 1) out += ", ";
    out += scalar(item);
  }
  return out + "]";
}

void write_indented(const JsonNode& node, const std::string& indent, std::string& out);

void write_entry(const std::string& key, const JsonNode& value, bool last, const std::string& indent,
                 std::string& out) {
  const std::string comment = value.comment.empty() ? "" : "  // " + value.comment;
  out += indent + (value.commented_out ? "// " : "") + key;
  if (fits_one_line(value)) {
    out += one_line(value) + (last ? "" : ",") + comment + "\n";
    return;
  }
  out += (value.kind == JsonNode::Kind::object ? "{" : "[") + comment + "\n";
  write_indented(value, indent + "  ", out);
  out += indent + (value.kind == JsonNode::Kind::object ? "}" : "]") + (last ? "" : ",") + "\n";
}

void write_indented(const JsonNode& node, const std::string& indent, std::string& out) {
  for (std::size_t i = 0; i < node.items.size(); ++i)
    write_entry("", node.items[i], i + 1 == node.items.size(), indent, out);
  std::size_t last = node.members.size();  // the last member that is not a comment: no comma behind it
  for (std::size_t i = 0; i < node.members.size(); ++i)
    if (!node.members[i].value.commented_out) last = i;
  for (std::size_t i = 0; i < node.members.size(); ++i)
    write_entry(quoted(node.members[i].key) + ": ", node.members[i].value, i == last, indent, out);
}

}  // namespace

std::string write_json(const JsonNode& node, JsonLayout layout) {
  std::string out;
  if (layout == JsonLayout::compact) {
    write_compact(node, out);
  } else {
    write_entry("", node, true, "", out);
  }
  return out;
}

}  // namespace graupel::io
