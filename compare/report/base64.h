// Base64 (RFC 4648), for data inside the report.
#pragma once

#include <string>
#include <string_view>

namespace graupel::compare {

std::string encode_base64(std::string_view bytes);

}  // namespace graupel::compare
