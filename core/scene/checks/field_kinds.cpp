#include "core/scene/checks/field_kinds.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace graupel {

std::vector<std::string_view> words_of_list(std::string_view text) {
  std::vector<std::string_view> words;
  while (!text.empty()) {
    const auto space = std::min(text.find(' '), text.size());
    if (space > 0) words.push_back(text.substr(0, space));
    text.remove_prefix(std::min(space + 1, text.size()));
  }
  return words;
}

const KindField& kind_of(const FieldInfo& info, const std::vector<KindField>& kinds) {
  const auto only = words_of_list(info.only_for);
  for (const auto& kind : kinds)
    if (std::find(kind.words.begin(), kind.words.end(), only.front()) != kind.words.end()) return kind;
  throw std::logic_error("field '" + std::string(info.name) + "' is only for '" + std::string(info.only_for) +
                         "', but no enum field declared before it has such a word");
}

bool applies(const FieldInfo& info, const std::vector<KindField>& kinds) {
  if (info.only_for.empty()) return true;
  const auto only = words_of_list(info.only_for);
  return std::find(only.begin(), only.end(), kind_of(info, kinds).current) != only.end();
}

}  // namespace graupel
