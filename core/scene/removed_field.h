// Keys that a config struct (core/scene/fields.h) had once. Files that have their default are still read; another value
// is an error that says why the key has gone. A struct lists its own as `static constexpr RemovedField removed[]`.
#pragma once

#include <string_view>

namespace graupel {

struct RemovedField {
  std::string_view name;
  std::string_view accepted;  ///< JSON, several forms apart by spaces: "0 0.0"
  std::string_view finding;   ///< why it has gone
};

}  // namespace graupel
