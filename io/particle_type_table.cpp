#include "io/particle_type_table.h"

#include <charconv>
#include <set>
#include <sstream>

#include "core/error.h"
#include "core/material_config.h"
#include "io/config_document.h"

namespace graupel::io {

namespace {

constexpr int64_t largest_written = 8;  // both programs have tables of nine types

struct Row {
  int64_t theirs;
  int32_t ours;
};
constexpr Row gns_rows[] = {{3, 3}, {4, 4}, {5, 5}, {6, 6}, {7, 7}, {8, 8}};
constexpr Row lagrangebench_rows[] = {{0, 5}, {1, 3}, {2, 13}, {4, 4}, {6, 6}, {7, 7}, {8, 8}};

void add_item(std::string& list, const char* between, const std::string& item) {
  if (!list.empty()) list += between;
  list += item;
}

std::vector<std::string_view> type_words() {
  std::vector<std::string_view> words = {"obstacle"};
  for (const auto& [word, model] : EnumWords<MaterialModel>::words) words.push_back(word);
  return words;
}

int32_t type_of_word(const std::string& word, const std::string& change) {
  if (word == "obstacle") return obstacle_particle_type;
  for (const auto& [name, model] : EnumWords<MaterialModel>::words)
    if (word == name) return particle_type_of(model);
  std::string known;
  for (const std::string_view name : type_words()) add_item(known, ", ", std::string(name));
  throw ConfigError("--types '" + change + "' names no material ('" + word + "', allowed: " + known +
                    "). Use one of these." + did_you_mean(word, type_words()));
}

}  // namespace

ParticleTypeTable::ParticleTypeTable(DataSetFormat format, const std::string& changes) : format_(format) {
  const auto add = [&](const auto& rows) {
    for (const Row& row : rows) {
      ours_[row.theirs] = row.ours;
      theirs_[row.ours] = row.theirs;
    }
  };
  format == DataSetFormat::gns ? add(gns_rows) : add(lagrangebench_rows);
  std::istringstream list(changes);
  for (std::string one; std::getline(list, one, ',');) change(one);
}

void ParticleTypeTable::change(const std::string& text) {
  const std::size_t sign = text.find('=');
  int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + std::min(sign, text.size()), number);
  if (sign == std::string::npos || error != std::errc() || end != text.data() + sign || number < 0)
    throw ConfigError("--types '" + text + "' is not NUMBER=MATERIAL. Example: --types 5=water,6=sand");
  const int32_t type = type_of_word(text.substr(sign + 1), text);
  ours_[number] = type;
  theirs_[type] = number;
}

std::vector<int32_t> ParticleTypeTable::to_ours(const std::vector<int64_t>& theirs, const std::string& where) const {
  std::vector<int32_t> out;
  std::set<int64_t> unknown;
  out.reserve(theirs.size());
  for (const int64_t type : theirs) {
    const auto found = ours_.find(type);
    if (found == ours_.end())
      unknown.insert(type);
    else
      out.push_back(found->second);
  }
  if (unknown.empty()) return out;
  std::string list, example;
  for (const int64_t type : unknown) {
    add_item(list, ", ", std::to_string(type));
    add_item(example, ",", std::to_string(type) + "=jelly");
  }
  throw InputError(where + " has particles whose material is not known (types " + list + " of " + word_of(format_) +
                   "). Say what they are, for instance --types " + example);
}

std::vector<int64_t> ParticleTypeTable::to_theirs(const std::vector<int32_t>& ours, const std::string& where) const {
  std::vector<int64_t> out;
  std::set<int32_t> unknown;
  out.reserve(ours.size());
  for (const int32_t type : ours) {
    const auto found = theirs_.find(type);
    if (found == theirs_.end() || found->second > largest_written)
      unknown.insert(type);
    else
      out.push_back(found->second);
  }
  if (unknown.empty()) return out;
  std::string list, example;
  for (const int32_t type : unknown) {
    add_item(list, ", ", particle_type_name(type));
    add_item(example, ",", std::string("N=").append(particle_type_name(type)));
  }
  throw InputError(where + " has particles that " + word_of(format_) + " has no type for (" + list +
                   "). Choose numbers from 0 to 8: --types " + example);
}

std::string ParticleTypeTable::name_of(int64_t theirs) const {
  const auto found = ours_.find(theirs);
  return found == ours_.end() ? std::to_string(theirs) : particle_type_name(found->second);
}

}  // namespace graupel::io
