// A text with one place in it changed, to break one rule of a good file.
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace graupel::io {

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

}  // namespace graupel::io
