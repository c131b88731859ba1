#include "io/trajectory/contact_datasets.h"

#include <algorithm>
#include <cmath>

namespace graupel::io {

namespace {

constexpr const char* names_attribute = "contact_names";

struct Quantity {
  const char *name, *units, *description;
  Vec3d ContactForce::*member;
};
constexpr std::array<Quantity, 4> quantities = {{
    {"contact_impulse", "N s", "Impulse on each obstacle and wall in the frame [frame, obstacle or wall, axis]",
     &ContactForce::impulse},
    {"contact_force", "N", "Mean force in the frame [frame, obstacle or wall, axis]", &ContactForce::force},
    {"contact_torque", "N m", "Mean torque in the frame, about the reference point [frame, obstacle or wall, axis]",
     &ContactForce::torque},
    {"contact_reference", "m", "Reference point of the torque at the frame [frame, obstacle or wall, axis]",
     &ContactForce::reference},
}};

hsize_t chunk_rows(hsize_t surfaces) {
  constexpr hsize_t chunk_bytes = 65536;
  return std::clamp<hsize_t>(chunk_bytes / (surfaces * sizeof(Vec3d)), 1, 512);
}

}  // namespace

ContactWriter::ContactWriter(hid_t group, const std::vector<std::string>& names) : surfaces_(names.size()) {
  hdf5::write_attribute(group, names_attribute, names);
  // Without filters, as times: chunks stay in their place when they grow.
  for (std::size_t q = 0; q < quantities.size(); ++q)
    datasets_[q] = hdf5::create_dataset(group, quantities[q].name,
                                        {.element = hdf5::Element::float64,
                                         .size = {0, surfaces_, 3},
                                         .chunk = {chunk_rows(surfaces_), surfaces_, 3},
                                         .early = true,
                                         .units = quantities[q].units,
                                         .description = quantities[q].description});
}

void ContactWriter::append(const FrameForces& forces) {
  if (forces.size() != surfaces_) throw hdf5::Failure("forces of other obstacles and walls");
  std::vector<Vec3d> row(forces.size());
  for (std::size_t q = 0; q < quantities.size(); ++q) {
    for (std::size_t i = 0; i < forces.size(); ++i) row[i] = forces[i].*quantities[q].member;
    hdf5::append_rows(datasets_[q], rows_, 1, {surfaces_, 3}, hdf5::Element::float64, row.data());
  }
  ++rows_;
}

void ContactWriter::close() {
  for (hdf5::Handle& dataset : datasets_) dataset.close("cannot close a dataset");
}

hsize_t ContactDatasets::row_count() const {
  hsize_t rows = datasets[0].size[0];
  for (const hdf5::Dataset& dataset : datasets) rows = std::min(rows, dataset.size[0]);
  return rows;
}

FrameForces ContactDatasets::read(hsize_t row) const {
  FrameForces forces(names.size());
  std::vector<Vec3d> values(names.size());
  for (std::size_t q = 0; q < quantities.size(); ++q) {
    datasets[q].read_rows(row, 1, hdf5::Element::float64, values.data());
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const Vec3d& value = values[i];
      if (!std::all_of(value.a, value.a + 3, [](double x) { return std::isfinite(x); }))
        throw hdf5::Failure("'" + std::string(quantities[q].name) + "' of '" + names[i] + "' in frame " +
                            std::to_string(row) + " is not finite");
      forces[i].*quantities[q].member = value;
    }
  }
  return forces;
}

std::optional<ContactDatasets> open_contact_datasets(hid_t group, uint64_t file_size) {
  if (!hdf5::has_member(group, quantities[0].name)) return std::nullopt;
  ContactDatasets found;
  found.names = hdf5::string_list_attribute(group, names_attribute);
  for (std::size_t q = 0; q < quantities.size(); ++q) {
    const std::string name = quantities[q].name;
    if (!hdf5::has_member(group, name)) throw hdf5::Failure("it lacks '" + name + "'");
    found.datasets[q] = hdf5::open_dataset(group, name, 3, hdf5::NumberKind::real, file_size);
    if (found.datasets[q].size[1] != found.names.size() || found.datasets[q].size[2] != 3)
      throw hdf5::Failure("'" + name + "' and the attribute '" + names_attribute + "' have different sizes");
  }
  return found;
}

}  // namespace graupel::io
