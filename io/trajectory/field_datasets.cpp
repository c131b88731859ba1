#include "io/trajectory/field_datasets.h"

#include <algorithm>

namespace graupel::io {

std::vector<hsize_t> field_row(ParticleField field, hsize_t particles) {
  const auto components = static_cast<hsize_t>(info_of(field).components);
  return components == 1 ? std::vector<hsize_t>{particles} : std::vector<hsize_t>{particles, components};
}

std::map<ParticleField, hdf5::Dataset> open_field_datasets(hid_t group, hsize_t particles, uint64_t file_size) {
  std::map<ParticleField, hdf5::Dataset> found;
  for (const ParticleField field : all_particle_fields) {
    const std::string name = info_of(field).name;
    if (!hdf5::has_member(group, name)) continue;
    const std::vector<hsize_t> row = field_row(field, particles);
    hdf5::Dataset dataset =
        hdf5::open_dataset(group, name, static_cast<int>(row.size()) + 1, hdf5::NumberKind::real, file_size);
    if (!std::equal(row.begin(), row.end(), dataset.size.begin() + 1))
      throw hdf5::Failure("'" + name + "' and 'position' have different sizes");
    found.emplace(field, std::move(dataset));
  }
  return found;
}

void read_field_row(const hdf5::Dataset& dataset, ParticleField field, hsize_t row, ParticleFields& fields) {
  fields[field].assign(static_cast<std::size_t>(dataset.size[1]) * static_cast<std::size_t>(info_of(field).components),
                       0.0f);
  dataset.read_rows(row, 1, hdf5::Element::float32, fields[field].data());
}

}  // namespace graupel::io
