// A JSON value that remembers its line: what config files are parsed to, and what the writers of config text fill.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace graupel::io {

struct JsonMember;

struct JsonNode {
  enum class Kind { null, boolean, integer, real, string, array, object };

  Kind kind = Kind::null;
  bool boolean = false;
  bool negative = false;   ///< of an integer
  uint64_t magnitude = 0;  ///< of an integer
  double real = 0;
  std::string text;
  std::vector<JsonNode> items;
  std::vector<JsonMember> members;  ///< in the file's order, no key twice

  int line = 0;               ///< in the file, from 1; 0 when it came from elsewhere
  std::string override_text;  ///< the "key.path=value" that set it; "" for none
  bool implied = false;       ///< made only because an override named something inside it

  std::string comment;         ///< written behind the value
  bool commented_out = false;  ///< written as a comment

  static JsonNode of(bool value);
  static JsonNode of(int64_t value);
  static JsonNode of(uint64_t value);
  static JsonNode of(double value);
  static JsonNode of(std::string value);
  static JsonNode of(const char* value);
  static JsonNode object();
  static JsonNode array();

  bool is_number() const { return kind == Kind::integer || kind == Kind::real; }
  double as_double() const;
  const JsonNode* find(std::string_view key) const;
  JsonNode* find(std::string_view key);
  /// Adds (or replaces) a member and returns it.
  JsonNode& set(std::string key, JsonNode value);
};

struct JsonMember {
  std::string key;
  JsonNode value;
};

/// Parses JSON with // and /* */ comments. Throws InputError with file, line and column where the text is no JSON, and
/// ConfigError beyond 16 MB, 64 levels or a million values, and for a key given twice. `name` stands for the file.
JsonNode parse_json(const std::string& text, const std::string& name);

enum class JsonLayout { compact, indented };
/// JSON text; numbers are written so that they read back to the same bits.
std::string write_json(const JsonNode& node, JsonLayout layout);

}  // namespace graupel::io
