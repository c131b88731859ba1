#include "io/gns_data_set.h"

#include <algorithm>

#include "core/error.h"
#include "io/npy_header.h"
#include "io/pickle.h"
#include "io/pickle_numbers.h"
#include "io/unreadable.h"
#include "io/zip_archive.h"

namespace graupel::io {

namespace {

constexpr const char* common_member = "gns_data.npy";

/// The array of objects in an .npy file, whose bytes it keeps.
struct ObjectArray {
  explicit ObjectArray(std::string file) : bytes(std::move(file)) {
    const NpyHeader header = read_npy_header(bytes);
    if (!header.element.starts_with("|O") && header.element != "O")
      throw Unreadable("it holds numbers of type '" + header.element.substr(0, 20) +
                       "', not the objects (positions, particle types) of a trajectory");
    pickle = read_pickle(std::string_view(bytes).substr(header.bytes));
    const PickleValue& root = pickle.root();
    if (root.kind != PickleKind::array || !root.complete || root.element.kind != 'O')
      throw Unreadable("its pickle holds no array of objects");
  }

  std::string bytes;
  Pickle pickle;
};

bool is_group(const PickleValue& value) {
  return value.kind == PickleKind::tuple || value.kind == PickleKind::list ||
         (value.kind == PickleKind::array && value.complete && value.element.kind == 'O' && value.shape.size() == 1);
}

const PickleValue& number_array(const PickleValue& value, const char* name) {
  if (value.kind != PickleKind::array || !value.complete || value.element.kind == 'O')
    throw Unreadable(std::string("its ") + name + " are no array of numbers");
  return value;
}

/// Positions, types and, with three parts, a material property.
using Parts = std::vector<const PickleValue*>;

Parts parts_of(const Pickle& pickle, const std::vector<uint32_t>& items) {
  if (items.size() != 2 && items.size() != 3)
    throw Unreadable("a trajectory has " + std::to_string(items.size()) +
                     " parts (2, positions and particle types, or 3, with a material property)");
  Parts parts;
  for (const uint32_t item : items) parts.push_back(&pickle.at(item));
  return parts;
}

/// Values of a part that is one number, or one for each particle.
template <typename Number, typename Read>
std::vector<Number> for_each_particle(const PickleValue& part, const char* name, int64_t particles, Read read) {
  const PickleValue& array = number_array(part, name);
  std::vector<Number> values = read(array);
  const bool column = array.shape.size() == 1 || (array.shape.size() == 2 && array.shape[1] == 1);
  if (array.shape.empty()) return std::vector<Number>(static_cast<std::size_t>(particles), values.at(0));
  if (!column || static_cast<int64_t>(values.size()) != particles)
    throw Unreadable(std::string("its ") + name + " have the shape " + shape_text(array.shape) + ", not (" +
                     std::to_string(particles) + ",) as the positions say");
  return values;
}

std::vector<int64_t> types_of(const PickleValue& part, int64_t particles) {
  if (part.kind == PickleKind::integer) return std::vector<int64_t>(static_cast<std::size_t>(particles), part.integer);
  return for_each_particle<int64_t>(part, "particle types", particles, whole_numbers);
}

std::vector<float> property_of(const PickleValue& part, int64_t particles) {
  const auto count = static_cast<std::size_t>(particles);
  if (part.kind == PickleKind::real) return std::vector<float>(count, static_cast<float>(part.real));
  if (part.kind == PickleKind::integer) return std::vector<float>(count, static_cast<float>(part.integer));
  return for_each_particle<float>(part, "material properties", particles, real_numbers);
}

ParticleSeries series_of(const Parts& parts) {
  const PickleValue& position = number_array(*parts[0], "positions");
  const auto& shape = position.shape;
  if (shape.size() != 3 || (shape[2] != 2 && shape[2] != 3) || shape[0] < 1 || shape[1] < 1)
    throw Unreadable("its positions have the shape " + shape_text(shape) + ", not (frames, particles, 2 or 3)");
  ParticleSeries series;
  series.frames = shape[0];
  series.particles = shape[1];
  series.dimensions = static_cast<int>(shape[2]);
  series.position = real_numbers(position);
  series.particle_type = types_of(*parts[1], series.particles);
  if (parts.size() == 3) series.material_property = property_of(*parts[2], series.particles);
  return series;
}

class GnsSplit : public SeriesReader {
 public:
  explicit GnsSplit(const std::string& file) : file_(file), archive_(file) {
    const auto& names = archive_.names();
    const auto common = std::find(names.begin(), names.end(), common_member);
    if (common == names.end()) {
      count_ = static_cast<int64_t>(names.size());
      return;
    }
    const auto member = static_cast<std::size_t>(common - names.begin());
    guarded(member, [&] {
      together_ = std::make_unique<ObjectArray>(archive_.read(member));
      const auto& shape = together_->pickle.root().shape;
      if (shape.empty() || shape.size() > 2 || shape[0] < 1)
        throw Unreadable("its array of trajectories has the shape " + shape_text(shape));
      count_ = shape[0];
    });
    common_ = member;
  }

  int64_t count() const override { return count_; }

  ParticleSeries read(int64_t i) const override {
    ParticleSeries series;
    const std::size_t member = together_ ? common_ : static_cast<std::size_t>(i);
    guarded(member, [&] { series = together_ ? from_common(i) : from_member(member); });
    series.where = "'" + file_ + "': '" + archive_.names()[member] + "'" +
                   (together_ ? ", trajectory " + std::to_string(i) : std::string());
    return series;
  }

 private:
  template <typename Body>
  void guarded(std::size_t member, Body&& body) const {
    try {
      body();
    } catch (const Unreadable& problem) {
      throw InputError("'" + file_ + "': cannot read '" + archive_.names()[member] + "' (" + problem.what() +
                       "). Give data of geoelements/gns, or make the file again");
    }
  }

  /// An array of the parts, or of the one tuple that has them.
  ParticleSeries from_member(std::size_t member) const {
    const ObjectArray array(archive_.read(member));
    const PickleValue& root = array.pickle.root();
    if (root.shape.size() > 1)
      throw Unreadable("its array of objects has the shape " + shape_text(root.shape) + ", not (2,) or (3,)");
    const bool wrapped = root.items.size() == 1 && is_group(array.pickle.at(root.items[0]));
    return series_of(parts_of(array.pickle, wrapped ? array.pickle.at(root.items[0]).items : root.items));
  }

  /// A row of a table, or an element of a list of tuples.
  ParticleSeries from_common(int64_t i) const {
    const Pickle& pickle = together_->pickle;
    const PickleValue& root = pickle.root();
    if (root.shape.size() == 2) {
      const auto first = root.items.begin() + static_cast<std::ptrdiff_t>(i * root.shape[1]);
      return series_of(parts_of(pickle, {first, first + static_cast<std::ptrdiff_t>(root.shape[1])}));
    }
    const PickleValue& group = pickle.at(root.items[static_cast<std::size_t>(i)]);
    if (!is_group(group)) throw Unreadable("trajectory " + std::to_string(i) + " is no tuple of arrays");
    return series_of(parts_of(pickle, group.items));
  }

  std::string file_;
  ZipReader archive_;
  std::unique_ptr<ObjectArray> together_;  ///< where all trajectories are in one member
  std::size_t common_ = 0;                 ///< that member
  int64_t count_ = 0;
};

std::string member_bytes(const ParticleSeries& series) {
  const int64_t parts = series.material_property.empty() ? 2 : 3;
  ObjectArrayPickle pickle(parts);
  pickle.add_f32({series.frames, series.particles, series.dimensions}, series.position);
  pickle.add_i64({series.particles}, series.particle_type);
  if (parts == 3) pickle.add_f32({series.particles}, series.material_property);
  return npy_object_header(parts) + std::move(pickle).finish();
}

}  // namespace

std::unique_ptr<SeriesReader> open_gns_split(const std::string& file) { return std::make_unique<GnsSplit>(file); }

void write_gns_split(const std::string& file, int64_t count, const SeriesSource& source) {
  std::vector<std::string> names;
  for (int64_t i = 0; i < count; ++i) names.push_back("simulation_trajectory_" + std::to_string(i) + ".npy");
  write_zip(file, names, [&](std::size_t i) { return member_bytes(source(static_cast<int64_t>(i))); });
}

}  // namespace graupel::io
