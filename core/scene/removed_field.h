// Keys that a config struct (core/scene/fields.h) had once. Files that have a value with the meaning of "switched off"
// are still read; another value is an error that says why the key has gone. A struct lists its own as `static constexpr
// RemovedField removed[]`; readers of JSON (io/config) and of weights' metadata (graph/config) ask the same list.
#pragma once

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

namespace graupel {

struct RemovedField {
  std::string_view name;
  std::string_view accepted;  ///< JSON, several forms apart by spaces: "0 0.0"
  std::string_view finding;   ///< why it has gone
};

/// The removed keys of a config struct; none where it lists none.
template <typename T>
std::vector<RemovedField> removed_fields() {
  if constexpr (requires { T::removed; }) return {std::begin(T::removed), std::end(T::removed)};
  return {};
}

/// The forms of RemovedField::accepted, apart.
inline std::vector<std::string_view> accepted_forms(const RemovedField& field) {
  std::vector<std::string_view> forms;
  for (std::string_view rest = field.accepted; !rest.empty();) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    forms.push_back(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return forms;
}

/// What is wrong with another value, to follow the key's name.
inline std::string removed_text(const RemovedField& field, const std::string& value) {
  return "is " + value + ", but this setting was removed: " + std::string(field.finding) +
         " (still read: " + std::string(accepted_forms(field).front()) + ")";
}

}  // namespace graupel
