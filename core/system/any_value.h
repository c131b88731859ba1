// A value of a config file that is passed on as it stands.
#pragma once

#include <string>

namespace graupel {

/// Any JSON value.
struct AnyValue {
  std::string json = "null";  ///< on one line, without comments
};

}  // namespace graupel
