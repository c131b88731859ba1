#include "io/lagrangebench_data_set.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "io/hdf5_dataset.h"
#include "io/trajectory_layout.h"

namespace graupel::io {

namespace {

constexpr hsize_t most_of_a_size = hsize_t(1) << 31;
constexpr hsize_t chunk_numbers = hsize_t(1) << 20;
constexpr int deflate_level = 4;  // h5py's default, as LagrangeBench writes

class LagrangeBenchSplit : public SeriesReader {
 public:
  explicit LagrangeBenchSplit(const std::string& file) : file_(file) {
    std::error_code code;
    file_size_ = std::filesystem::file_size(file, code);
    if (code) throw InputError("cannot read '" + file + "' (" + code.message() + "). Give a LagrangeBench data set");
    guarded([&] {
      handle_ = hdf5::open_file(file);
      groups_ = hdf5::member_names(handle_);
    });
    if (groups_.empty()) throw InputError("'" + file + "' holds no trajectory. Make it again, or choose another");
  }

  int64_t count() const override { return static_cast<int64_t>(groups_.size()); }

  ParticleSeries read(int64_t i) const override {
    ParticleSeries series;
    const std::string& name = groups_[static_cast<std::size_t>(i)];
    series.where = "'" + file_ + "': trajectory " + name;
    guarded([&] {
      const hdf5::Handle group(H5Gopen2(handle_, name.c_str(), H5P_DEFAULT), H5Gclose,
                               ("'" + name + "' is no group").c_str());
      read_positions(group, series);
      read_types(group, series);
    });
    return series;
  }

 private:
  template <typename Body>
  void guarded(Body&& body) const {
    try {
      body();
    } catch (const hdf5::Failure& failure) {
      throw InputError("cannot read '" + file_ + "' (" + failure.what() +
                       "). The file is damaged, cut short or of another kind; make it again or choose another");
    }
  }

  void read_positions(hid_t group, ParticleSeries& series) const {
    const auto dataset = hdf5::open_dataset(group, "position", 3, hdf5::NumberKind::real, file_size_);
    const auto& size = dataset.size;
    if (size[2] != 2 && size[2] != 3) throw hdf5::Failure("'position' is not 2- or 3-dimensional");
    if (size[0] == 0 || size[1] == 0 || size[0] > most_of_a_size || size[1] > most_of_a_size)
      throw hdf5::Failure("'position' has a number of frames or particles that is not believable");
    series.frames = static_cast<int64_t>(size[0]);
    series.particles = static_cast<int64_t>(size[1]);
    series.dimensions = static_cast<int>(size[2]);
    series.position.resize(size[0] * size[1] * 3);
    dataset.read_rows(0, size[0], hdf5::Element::float32, series.position.data());
    if (series.dimensions == 3) return;
    for (std::size_t k = 0; k < size[0] * size[1]; ++k)  // they were placed 3 apart
      for (std::size_t axis = 0; axis < 2; ++axis) series.position[2 * k + axis] = series.position[3 * k + axis];
    series.position.resize(size[0] * size[1] * 2);
  }

  void read_types(hid_t group, ParticleSeries& series) const {
    const auto dataset = hdf5::open_dataset(group, "particle_type", 1, hdf5::NumberKind::integer, file_size_);
    if (static_cast<int64_t>(dataset.size[0]) != series.particles)
      throw hdf5::Failure("'particle_type' and 'position' have different numbers of particles");
    std::vector<int32_t> types(dataset.size[0]);
    dataset.read_rows(0, dataset.size[0], hdf5::Element::int32, types.data());
    series.particle_type.assign(types.begin(), types.end());
  }

  std::string file_;
  uint64_t file_size_ = 0;
  hdf5::Handle handle_;
  std::vector<std::string> groups_;
};

void write_trajectory(hid_t file, int64_t number, const ParticleSeries& series) {
  hdf5::Handle group = hdf5::create_group(file, trajectory_group(number));
  const auto frames = static_cast<hsize_t>(series.frames), particles = static_cast<hsize_t>(series.particles),
             axes = static_cast<hsize_t>(series.dimensions);
  const hsize_t chunk_particles = std::min(particles, chunk_numbers / axes);
  const hsize_t chunk_frames =
      std::clamp<hsize_t>(chunk_numbers / (chunk_particles * axes), 1, std::min<hsize_t>(frames, 8));
  hdf5::Handle position = hdf5::create_dataset(group, "position",
                                               {.element = hdf5::Element::float32,
                                                .size = {frames, particles, axes},
                                                .chunk = {chunk_frames, chunk_particles, axes},
                                                .deflate = deflate_level,
                                                .units = "m",
                                                .description = "Particle positions [frame, particle, axis]"});
  hdf5::write_all(position, hdf5::Element::float32, series.position.data());
  position.close("cannot write the positions");
  const std::vector<int32_t> types(series.particle_type.begin(), series.particle_type.end());
  hdf5::Handle type = hdf5::create_dataset(group, "particle_type",
                                           {.element = hdf5::Element::int32,
                                            .size = {particles},
                                            .units = "",
                                            .description = "0 fluid, 1 wall, 2 moving wall, 3 rigid body"});
  hdf5::write_all(type, hdf5::Element::int32, types.data());
  type.close("cannot write the types");
  group.close("cannot close a group");
  hdf5::check(H5Fflush(file, H5F_SCOPE_LOCAL), "cannot flush");
}

}  // namespace

std::unique_ptr<SeriesReader> open_lagrangebench_split(const std::string& file) {
  return std::make_unique<LagrangeBenchSplit>(file);
}

void write_lagrangebench_split(const std::string& file, int64_t count, const SeriesSource& source) {
  try {
    hdf5::Handle out = hdf5::create_file(file);
    int64_t frames = 0;
    for (int64_t i = 0; i < count; ++i) {
      const ParticleSeries series = source(i);
      if (i > 0 && series.frames != frames)
        throw InputError(series.where + " has " + std::to_string(series.frames) + " frames, those before it " +
                         std::to_string(frames) + ", and LagrangeBench reads one number for all. Make them equal, or " +
                         "convert to gns");
      frames = series.frames;
      write_trajectory(out, i, series);
    }
    out.close("cannot close the file");
  } catch (const hdf5::Failure& failure) {
    throw IoError("cannot write '" + file + "' (" + failure.what() +
                  "). Free space on that disk or choose another folder");
  }
}

}  // namespace graupel::io
