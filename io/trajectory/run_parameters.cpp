#include "io/trajectory/run_parameters.h"

#include <iterator>
#include <sstream>

namespace graupel::io {

namespace {

constexpr const char* names_attribute = "parameter_names";
constexpr const char* units_attribute = "parameter_units";
constexpr const char* values_attribute = "parameter_values";
constexpr const char* keys_attribute = "parameter_keys";

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::vector<std::string> split(const std::string& text) {
  std::istringstream words(text);
  return {std::istream_iterator<std::string>(words), {}};
}

}  // namespace

void write_parameters(hid_t group, const std::vector<NamedValue>& values) {
  if (values.empty()) return;
  std::vector<std::string> names, units, keys;
  std::vector<double> numbers;
  for (const NamedValue& value : values) {
    names.push_back(value.name);
    units.push_back(value.unit);
    numbers.push_back(value.value);
    keys.push_back(joined(value.keys));
  }
  hdf5::write_attribute(group, names_attribute, names);
  hdf5::write_attribute(group, units_attribute, units);
  hdf5::write_attribute(group, values_attribute, numbers);
  hdf5::write_attribute(group, keys_attribute, keys);
}

std::vector<NamedValue> read_parameters(hid_t group) {
  const std::vector<std::string> names = hdf5::string_list_attribute(group, names_attribute);
  const std::vector<std::string> units = hdf5::string_list_attribute(group, units_attribute);
  const std::vector<double> numbers = hdf5::real_list_attribute(group, values_attribute);
  const std::vector<std::string> keys = hdf5::string_list_attribute(group, keys_attribute);
  if (units.size() != names.size() || numbers.size() != names.size())
    throw hdf5::Failure("its parameters have " + std::to_string(names.size()) + " names, " +
                        std::to_string(units.size()) + " units and " + std::to_string(numbers.size()) + " values");
  std::vector<NamedValue> values;
  for (std::size_t i = 0; i < names.size(); ++i)
    values.push_back({names[i], units[i], numbers[i], i < keys.size() ? split(keys[i]) : std::vector<std::string>{}});
  return values;
}

bool is_parameter_attribute(const std::string& name) {
  return name == names_attribute || name == units_attribute || name == values_attribute || name == keys_attribute;
}

}  // namespace graupel::io
