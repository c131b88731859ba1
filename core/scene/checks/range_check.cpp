#include "core/scene/checks/range_check.h"

#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/checks/field_kinds.h"
#include "core/scene/checks/range_text.h"
#include "core/system/error.h"

namespace graupel {

namespace {

std::string item(const std::string& list, std::size_t index) { return list + "[" + std::to_string(index) + "]"; }

/// Walks through all that a struct declares; a type that has no number is nothing to it.
struct RangeCheck {
  template <typename T>
  void value(const std::string& place, const Range& range, const T& what) const {
    if constexpr (std::is_same_v<T, double> || std::is_same_v<T, int64_t>) {
      const auto number = static_cast<double>(what);
      if (std::isfinite(number) && range.contains(number)) return;
      const std::string allowed = range_text(range);
      throw ConfigError(place + " is out of range (" + number_text(number) + ", allowed " +
                        (allowed.empty() ? "finite numbers" : allowed) + "). Change the value");
    } else if constexpr (ConfigStruct<T>) {
      fields(place, what);
    }
  }
  void value(const std::string& place, const Range& range, const Vec3d& vector) const {
    for (std::size_t d = 0; d < 3; ++d) value(item(place, d), range, vector[d]);
  }
  template <typename T>
  void value(const std::string& place, const Range& range, const std::optional<T>& what) const {
    if (what) value(place, range, *what);
  }
  template <typename T>
  void value(const std::string& place, const Range& range, const std::vector<T>& list) const {
    for (std::size_t i = 0; i < list.size(); ++i) value(item(place, i), range, list[i]);
  }
  template <typename T>
  void value(const std::string& place, const Range& range, const std::map<std::string, T>& named) const {
    for (const auto& [name, one] : named) value(place + "." + name, range, one);
  }

  template <ConfigStruct T>
  void fields(const std::string& place, const T& what) const {
    std::vector<KindField> kinds;
    T::fields([&](auto member, const FieldInfo& info) {
      using Field = std::remove_cvref_t<decltype(what.*member)>;
      if constexpr (ConfigEnum<Field>) kinds.push_back({info.name, enum_words<Field>(), word_of(what.*member)});
      if (applies(info, kinds))
        value((place.empty() ? "" : place + ".") + std::string(info.name), info.range, what.*member);
    });
  }
};

}  // namespace

void check_ranges(const Scene& scene) { RangeCheck().fields("", scene); }

}  // namespace graupel
