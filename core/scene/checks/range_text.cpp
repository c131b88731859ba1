#include "core/scene/checks/range_text.h"

#include <charconv>
#include <cmath>

namespace graupel {

std::string number_text(double value) {
  char digits[40];
  return std::string(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

std::string range_text(const Range& range) {
  std::string text;
  if (std::isfinite(range.low)) text = (range.low_open ? "> " : ">= ") + number_text(range.low);
  if (std::isfinite(range.high)) {
    if (!text.empty()) text += " and ";
    text += (range.high_open ? "< " : "<= ") + number_text(range.high);
  }
  return text;
}

}  // namespace graupel
