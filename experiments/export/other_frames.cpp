#include "experiments/export/other_frames.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "core/system/atomic_file.h"

namespace graupel::experiments {

namespace {

struct NumberedName {
  std::string_view series;
  int64_t number = 0;
};

/// "run_0007" as run and 7: exports write four digits at least.
std::optional<NumberedName> split_number(std::string_view stem) {
  const std::size_t at = stem.rfind('_');
  if (at == std::string_view::npos || stem.size() < at + 5) return std::nullopt;
  const std::string_view digits = stem.substr(at + 1);
  if (digits.find_first_not_of("0123456789") != std::string_view::npos) return std::nullopt;
  NumberedName name = {stem.substr(0, at)};
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), name.number);
  return code == std::errc() ? std::optional(name) : std::nullopt;
}

}  // namespace

std::vector<std::string> other_frames(const std::string& folder, const std::string& name, bool of_materials,
                                      const std::string& ending, const std::vector<int64_t>& frames) {
  std::vector<std::string> others;
  for (const std::string& file : names_in(folder)) {
    if (!file.ends_with(ending)) continue;
    const auto split = split_number(std::string_view(file).substr(0, file.size() - ending.size()));
    if (!split || std::binary_search(frames.begin(), frames.end(), split->number)) continue;
    if (of_materials ? split->series.starts_with(name + "_") : split->series == name) others.push_back(file);
  }
  return others;
}

}  // namespace graupel::experiments
