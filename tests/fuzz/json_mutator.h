// Changes JSON text so that it stays JSON: what tries the checks behind the parser.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace graupel::fuzz {

using Json = nlohmann::ordered_json;

/// Changes, removes, doubles or moves one value somewhere in the tree.
void mutate_json(Json& root, Random& random);

/// A number at an edge of what numbers can be, as text: "1e308", "-0", "9223372036854775808".
std::string edge_number(Random& random);

/// Text that is JSON (comments may be in it): mutate_json(), or mutate_bytes() in one of four cases and where it is
/// none.
std::string mutate_json_text(const std::string& text, std::size_t most, Random& random);

}  // namespace graupel::fuzz
