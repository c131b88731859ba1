// JSON as text.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace graupel::experiments {

/// On one line where `indent` is negative. Names of files may hold bytes that are no UTF-8: they become U+FFFD.
template <typename Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace graupel::experiments
