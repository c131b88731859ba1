// A config file in memory (JSON text with overrides applied) and the errors that name a place in it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/scene/checks/range_text.h"
#include "core/scene/fields.h"
#include "core/system/error.h"
#include "io/config/json_node.h"

namespace graupel::io {

/// The list that the key at a path ("domain", "size") stands for where a text lacks it; none for keys without a default
/// and those of other values.
using DefaultLists = std::function<std::optional<JsonNode>(const std::vector<std::string>& path)>;

struct ConfigDocument {
  std::string name;  ///< stands for the file in messages
  JsonNode root;
  /// Where set, what is wrong is put here and reading goes on, so that a file's mistakes are found together.
  std::vector<std::string>* mistakes = nullptr;

  /// Runs `part` of the reading, which may throw ConfigError or InputError; with `mistakes` the error's text goes there
  /// and the answer is false.
  template <typename Part>
  bool attempt(Part part) const {
    if (!mistakes) return part(), true;
    try {
      return part(), true;
    } catch (const Error& error) {
      mistakes->push_back(error.what());
      return false;
    }
  }

  /// Parses `text` and applies "key.path=value" overrides (list items by number: "sources.0.radius=0.1"; values as
  /// JSON, bare words as strings). An override of an item of a list that the text lacks changes its default. Throws
  /// ConfigError. parse_document() of config_writer.h knows the defaults of a struct.
  static ConfigDocument parse(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides = {}, const DefaultLists& defaults = {});
};

/// The value of an override: JSON, or a bare word as a string. Throws ConfigError that begins with `where` for a list,
/// object or string that is not closed.
JsonNode override_value(const std::string& value, const std::string& where);
/// Says of a value and all inside it that the override `text` made it.
void mark_override(JsonNode& node, const std::string& text);

/// A value and where it stands.
struct ConfigPlace {
  const ConfigDocument& document;
  std::string pointer;  ///< JSON pointer, "" for the whole document
  const JsonNode& node;

  ConfigPlace child(std::string_view key, const JsonNode& value) const;
  ConfigPlace child(std::size_t index, const JsonNode& value) const {
    return child(std::string_view(std::to_string(index)), value);
  }
  /// "scene.json:12: /domain/dx" or "scene.json (override domain.dx=-1): /domain/dx".
  std::string text() const;
  /// The value as short JSON.
  std::string value() const;
};

/// The place of an existing value, by keys and indices: {"sources", "0", "file"}; the innermost one that exists.
ConfigPlace find_place(const ConfigDocument& document, const std::vector<std::string>& keys);

/// Throws ConfigError "<place> <problem>. <remedy>".
[[noreturn]] void config_fail(const ConfigPlace& place, const std::string& problem, const std::string& remedy);

/// " Did you mean 'x'?" for the closest candidate, or "" when none is close.
std::string did_you_mean(std::string_view word, const std::vector<std::string_view>& candidates);

}  // namespace graupel::io
