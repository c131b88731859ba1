// Configuration structs declare each field once: name, unit, meaning, range, which kinds it applies to. The JSON
// reader, `--print-defaults`, docs/reference/scene_format.md and scenes/schema.json are all made from these
// declarations (io/).
//
//   struct Domain {
//     double dx = 1.0 / 64;
//     template <typename Visitor> static void fields(Visitor&& visit) {
//       visit(&Domain::dx, FieldInfo{"dx", "m", "Grid spacing", Range::positive()});
//     }
//   };
//
// Member types: bool, int64_t, double, std::string, Vec3d, Interval, WholeInterval, AnyValue, an enum with EnumWords,
// another such struct, std::optional, std::vector or std::map<std::string, ...> of these.
#pragma once

#include <array>
#include <limits>
#include <string_view>
#include <utility>

namespace graupel {

/// Allowed values of a number (of each component of a vector).
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;  ///< the bound itself is not allowed
  bool high_open = false;

  static constexpr Range positive() { return {.low = 0, .low_open = true}; }
  static constexpr Range not_negative() { return {.low = 0}; }
  static constexpr Range between(double low, double high) { return {.low = low, .high = high}; }
  constexpr bool contains(double x) const {
    return (low_open ? x > low : x >= low) && (high_open ? x < high : x <= high);
  }
};

struct FieldInfo {
  std::string_view name;
  std::string_view unit;     ///< SI; "" for none
  std::string_view meaning;  ///< one sentence for the docs
  Range range = {};
  bool required = false;           ///< no default: the reader insists on it (for the kinds it applies to)
  std::string_view only_for = {};  ///< space-separated words of the struct's kind field ("shape", "model"); "" = all
  /// Space-separated: what messages, docs and schema offer of an enum's words or for a text; "" = all. A check of the
  /// struct says why it refuses another word of the enum.
  std::string_view offered = {};

  constexpr FieldInfo mandatory() const { return {name, unit, meaning, range, true, only_for, offered}; }
  constexpr FieldInfo only_in(std::string_view kinds) const {
    return {name, unit, meaning, range, required, kinds, offered};
  }
  constexpr FieldInfo offering(std::string_view words) const {
    return {name, unit, meaning, range, required, only_for, words};
  }
};

/// Specialise with `static constexpr std::pair<const char*, E> words[]` for every enum used in a config, or declare
/// `constexpr auto enum_list(E)` beside it, which returns a std::array of these pairs.
template <typename E>
struct EnumWords;
template <typename E>
requires requires { enum_list(E()); }
struct EnumWords<E> {
  static constexpr auto words = enum_list(E());
};

/// Word of an enum value, e.g. "slip".
template <typename E>
constexpr const char* word_of(E value) {
  for (const auto& [word, v] : EnumWords<E>::words)
    if (v == value) return word;
  return "?";
}

}  // namespace graupel
