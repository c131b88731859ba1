// What the command lines of Graupel's programs share: numbers with a plain message, and "did you mean". Needs CLI11;
// for the programs only.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/system/edit_distance.h"

namespace graupel {

/// A whole number from `low` to `high`.
inline CLI::Validator whole_number(int64_t low, int64_t high = std::numeric_limits<int64_t>::max()) {
  const auto check = [low, high](std::string& text) -> std::string {
    int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size() && value >= low && value <= high) return "";
    std::string range = "a whole number, " + std::to_string(low);
    range += high == std::numeric_limits<int64_t>::max() ? " or more" : " to " + std::to_string(high);
    return "'" + text + "' is not usable (allowed: " + range + ")";
  };
  return CLI::Validator(check, "");
}

/// What a real number may be at least.
enum class LowerBound { zero, above_zero };

/// A finite number.
inline CLI::Validator real_number(LowerBound bound) {
  const auto check = [bound](std::string& text) -> std::string {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size() && std::isfinite(value) &&
        (bound == LowerBound::zero ? value >= 0 : value > 0))
      return "";
    return "'" + text + "' is not usable (allowed: a number" +
           (bound == LowerBound::zero ? ", 0 or more)" : " above 0)");
  };
  return CLI::Validator(check, "");
}

/// A number from `low` to `high`.
inline CLI::Validator real_number(double low, double high) {
  const auto check = [low, high](std::string& text) -> std::string {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size() && value >= low && value <= high) return "";
    return "'" + text + "' is not usable (allowed: a number, " + CLI::detail::to_string(low) + " to " +
           CLI::detail::to_string(high) + ")";
  };
  return CLI::Validator(check, "");
}

/// CLI11's message, with the closest verb or flag for each mistyped one.
inline std::string parse_error_text(const CLI::App& app, const CLI::ParseError& error) {
  std::string text = error.what();
  const CLI::App* verb = app.get_subcommands().empty() ? &app : app.get_subcommands().front();
  std::vector<std::string> known;
  for (const CLI::App* word : verb->get_subcommands({})) known.push_back(word->get_name());
  for (const CLI::Option* option : verb->get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (const std::string& word : verb->remaining(true)) {
    const std::string close = closest_of(word.substr(0, word.find('=')), known);
    if (!close.empty()) text += ". Did you mean '" + close + "' instead of '" + word + "'?";
  }
  return text;
}

}  // namespace graupel
