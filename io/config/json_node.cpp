// Making and looking into JSON values.
#include "io/config/json_node.h"

namespace graupel::io {

JsonNode JsonNode::of(bool value) {
  JsonNode node;
  node.kind = Kind::boolean;
  node.boolean = value;
  return node;
}

JsonNode JsonNode::of(int64_t value) {
  JsonNode node = of(value < 0 ? uint64_t(0) - static_cast<uint64_t>(value) : static_cast<uint64_t>(value));
  node.negative = value < 0;
  return node;
}

JsonNode JsonNode::of(uint64_t value) {
  JsonNode node;
  node.kind = Kind::integer;
  node.magnitude = value;
  return node;
}

JsonNode JsonNode::of(double value) {
  JsonNode node;
  node.kind = Kind::real;
  node.real = value;
  return node;
}

JsonNode JsonNode::of(std::string value) {
  JsonNode node;
  node.kind = Kind::string;
  node.text = std::move(value);
  return node;
}

JsonNode JsonNode::of(const char* value) { return of(std::string(value)); }

JsonNode JsonNode::object() {
  JsonNode node;
  node.kind = Kind::object;
  return node;
}

JsonNode JsonNode::array() {
  JsonNode node;
  node.kind = Kind::array;
  return node;
}

double JsonNode::as_double() const {
  if (kind == Kind::real) return real;
  const double value = static_cast<double>(magnitude);
  return negative ? -value : value;
}

const JsonNode* JsonNode::find(std::string_view key) const {
  for (const auto& member : members)
    if (member.key == key) return &member.value;
  return nullptr;
}

JsonNode* JsonNode::find(std::string_view key) {
  for (auto& member : members)
    if (member.key == key) return &member.value;
  return nullptr;
}

JsonNode& JsonNode::set(std::string key, JsonNode value) {
  if (JsonNode* old = find(key)) return *old = std::move(value);
  members.push_back({std::move(key), std::move(value)});
  return members.back().value;
}

}  // namespace graupel::io
