// Reads single values of a config file: checks type and range, and words the errors.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/checks/field_kinds.h"
#include "core/scene/fields.h"
#include "core/scene/removed_field.h"
#include "io/config/config_document.h"

namespace graupel::io {

bool read_boolean(const ConfigPlace& place);
int64_t read_integer(const ConfigPlace& place, const Range& range);
uint64_t read_natural(const ConfigPlace& place, const Range& range);
double read_number(const ConfigPlace& place, const Range& range);
std::string read_string(const ConfigPlace& place);
/// `count` numbers, each within the range, to `out`.
void read_numbers(const ConfigPlace& place, const Range& range, double* out, std::size_t count);
/// The two ends of an interval [low, high].
const std::vector<JsonNode>& read_interval_ends(const ConfigPlace& place);
[[noreturn]] void interval_out_of_order(const ConfigPlace& place);
/// Index of the value among `words`. `offered` are those that an error names, as FieldInfo has it.
std::size_t read_word(const ConfigPlace& place, const std::vector<std::string_view>& words,
                      std::string_view offered = {});
const std::vector<JsonNode>& read_list(const ConfigPlace& place);
const std::vector<JsonMember>& read_members(const ConfigPlace& place);

/// Throws for keys that are none of `fields` ("$schema" is allowed at the top level), and for `removed` ones with
/// another value than their default.
void check_keys(const ConfigPlace& place, const std::vector<std::string_view>& fields,
                const std::vector<RemovedField>& removed = {});
/// Throws for a required key that is missing and for one that belongs to another kind. Returns the key's value, or
/// null.
const JsonNode* check_field(const ConfigPlace& place, const FieldInfo& info, const std::vector<KindField>& kinds);
/// Throws for an entry that exists only because an override named a key inside it.
void check_entry(const ConfigPlace& map, const std::string& key, const ConfigPlace& entry);

}  // namespace graupel::io
