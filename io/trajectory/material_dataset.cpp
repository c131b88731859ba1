#include "io/trajectory/material_dataset.h"

#include "core/scene/material_config.h"

namespace graupel::io {

namespace {

constexpr const char* dataset_name = "material";
constexpr const char* names_attribute = "material_names";
constexpr int32_t none = -1;

void check_materials(const ParticleMaterials& materials, const std::vector<int32_t>& particle_type) {
  const auto count = static_cast<int32_t>(materials.names.size());
  for (std::size_t i = 0; i < particle_type.size(); ++i) {
    const int32_t index = materials.index[i], least = particle_type[i] == obstacle_particle_type ? none : 0;
    if (index < least || index >= count)
      throw hdf5::Failure("'material' of particle " + std::to_string(i) + " is " + std::to_string(index) +
                          " (allowed: " + std::to_string(least) + " to " + std::to_string(count - 1) +
                          ", places in the attribute 'material_names')");
  }
}

}  // namespace

void write_materials(hid_t group, const ParticleMaterials& materials) {
  if (materials.empty()) return;
  hdf5::write_attribute(group, names_attribute, materials.names);
  const hdf5::Handle dataset = hdf5::create_dataset(group, dataset_name,
                                                    {.element = hdf5::Element::int32,
                                                     .size = {materials.index.size()},
                                                     .description = "Place in material_names, -1 none [particle]"});
  hdf5::write_all(dataset, hdf5::Element::int32, materials.index.data());
}

ParticleMaterials read_materials(hid_t group, const std::vector<int32_t>& particle_type, uint64_t file_size,
                                 bool is_whole) {
  ParticleMaterials materials;
  if (!hdf5::has_member(group, dataset_name)) return materials;
  materials.names = hdf5::string_list_attribute(group, names_attribute);
  if (materials.names.empty()) throw hdf5::Failure("'material' lacks its attribute 'material_names' (1 to 4096 texts)");
  hdf5::Dataset dataset = hdf5::open_dataset(group, dataset_name, 1, hdf5::NumberKind::integer, file_size);
  if (dataset.size[0] != particle_type.size())
    throw hdf5::Failure("'material' has " + std::to_string(dataset.size[0]) + " particles, and 'particle_type' " +
                        std::to_string(particle_type.size()));
  if (is_whole && dataset.missing_chunks() > 0) throw hdf5::Failure("values of 'material' are missing");
  dataset.is_whole = is_whole;
  materials.index.resize(particle_type.size());
  dataset.read_rows(0, particle_type.size(), hdf5::Element::int32, materials.index.data());
  check_materials(materials, particle_type);
  return materials;
}

}  // namespace graupel::io
