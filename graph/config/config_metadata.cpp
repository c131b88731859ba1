#include "graph/config/config_metadata.h"

namespace graupel::graph {

namespace metadata {

std::string range_text(const Range& range) {
  const auto bound = [](double x) { return std::isinf(x) ? std::string(x < 0 ? "-inf" : "inf") : text_of(x); };
  return (range.low_open ? "above " : "from ") + bound(range.low) + " to " + bound(range.high);
}

std::string key_of(const std::string& prefix, const FieldInfo& info) { return prefix + std::string(info.name); }

std::string where(const std::string& file, const std::string& key) {
  return "'" + file + "': metadata key '" + key + "' ";
}

std::vector<std::string> metadata_forms(const RemovedField& field) {
  std::vector<std::string> forms;
  for (std::string_view form : accepted_forms(field)) {
    if (form.size() > 1 && form.front() == '"') form = form.substr(1, form.size() - 2);
    forms.emplace_back(form);
  }
  return forms;
}

void check_removed(const RemovedField& field, const std::string& value, const std::string& where) {
  const std::vector<std::string> forms = metadata_forms(field);
  if (std::find(forms.begin(), forms.end(), value) == forms.end())
    throw InputError(where + removed_text(field, value) + ". Train a network without it");
}

}  // namespace metadata

}  // namespace graupel::graph
