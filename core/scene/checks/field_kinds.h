// Structs that declare their fields (core/scene/fields.h), and which of them belong to a struct's present kind.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "core/scene/fields.h"

namespace graupel {

struct AnyVisitor {
  template <typename Member>
  void operator()(Member, const FieldInfo&) const {}
};
template <typename T>
concept ConfigStruct = requires {
  T::fields(AnyVisitor());
};
template <typename T>
concept ConfigEnum = std::is_enum_v<T> && requires {
  EnumWords<T>::words;
};

template <ConfigEnum E>
std::vector<std::string_view> enum_words() {
  std::vector<std::string_view> words;
  words.reserve(std::size(EnumWords<E>::words));
  for (const auto& [word, value] : EnumWords<E>::words) words.push_back(word);
  return words;
}

/// An enum field of the struct being read, as `only_for` of later fields refers to it.
struct KindField {
  std::string_view name;
  std::vector<std::string_view> words;
  std::string_view current;
};

/// The words of FieldInfo::only_for.
std::vector<std::string_view> words_of_list(std::string_view text);
/// The enum field that `only_for` speaks of: the first declared one with such a word. A struct without one is a
/// programmer's mistake (std::logic_error).
const KindField& kind_of(const FieldInfo& info, const std::vector<KindField>& kinds);
/// Whether the field belongs to the struct's present kind.
bool applies(const FieldInfo& info, const std::vector<KindField>& kinds);

}  // namespace graupel
