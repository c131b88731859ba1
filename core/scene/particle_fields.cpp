#include "core/scene/particle_fields.h"

#include <sstream>

#include "core/system/edit_distance.h"
#include "core/system/error.h"

namespace graupel {

namespace {

constexpr ParticleFieldInfo table[] = {
    {"stress", 6, "Pa", "Kirchhoff stress: xx, xy, xz, yy, yz, zz [frame, particle, component]"},
    {"affine", 9, "1/s", "Affine velocity C, row by row [frame, particle, component]"},
    {"deformation_gradient", 9, "",
     "Elastic deformation gradient F, row by row; identity for water [frame, particle, component]"},
    {"plastic", 1, "",
     "Volume ratio J (water, jelly, neo_hookean, toothpaste), plastic volume ratio J_p (snow), volume correction v_c "
     "(sand), equivalent plastic strain (metal, cake, foam) [frame, particle]"},
};

std::vector<std::string> all_names() {
  std::vector<std::string> names;
  for (const ParticleFieldInfo& info : table) names.emplace_back(info.name);
  return names;
}

ParticleField field_named(const std::string& name) {
  for (const ParticleField field : all_particle_fields)
    if (name == info_of(field).name) return field;
  std::string allowed;
  for (const std::string& known : all_names()) {
    allowed += allowed.empty() ? "" : ", ";
    allowed += known;
  }
  const std::string close = closest_of(name, all_names());
  throw ConfigError("there is no field '" + name + "' (allowed: " + allowed + "). " +
                    (close.empty() ? std::string("Name one or several of these, separated by commas")
                                   : "Did you mean '" + close + "'?"));
}

std::string without_spaces_around(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

}  // namespace

const ParticleFieldInfo& info_of(ParticleField field) { return table[static_cast<std::size_t>(field)]; }

FieldSet FieldSet::parse(const std::string& names) {
  FieldSet set;
  if (names.empty()) return set;
  std::istringstream stream(names + ",");
  for (std::string name; std::getline(stream, name, ',');) set.add(field_named(without_spaces_around(name)));
  return set;
}

std::string FieldSet::names() const {
  std::string text;
  for (const ParticleField field : all_particle_fields) {
    if (!contains(field)) continue;
    text += text.empty() ? "" : ",";
    text += info_of(field).name;
  }
  return text;
}

int FieldSet::components() const {
  int sum = 0;
  for (const ParticleField field : all_particle_fields)
    if (contains(field)) sum += info_of(field).components;
  return sum;
}

}  // namespace graupel
