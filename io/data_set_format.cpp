#include "io/data_set_format.h"

#include <filesystem>
#include <optional>

#include "core/error.h"
#include "io/hdf5.h"
#include "io/trajectory_layout.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

/// Files of our own say so; LagrangeBench's say nothing.
DataSetFormat format_of_hdf5(const std::string& file) {
  try {
    const hdf5::Handle handle = hdf5::open_file(file);
    const bool ours = hdf5::string_attribute(handle, "format") == std::string(trajectory_format);
    return ours ? DataSetFormat::graupel : DataSetFormat::lagrangebench;
  } catch (const hdf5::Failure& failure) {
    throw InputError("cannot read '" + file + "' (" + failure.what() +
                     "). The file is damaged, cut short or no HDF5; make it again or remove it");
  }
}

}  // namespace

std::string split_file(DataSetFormat format, const std::string& split) {
  return split + (format == DataSetFormat::gns ? ".npz" : ".h5");
}

DataSetFormat format_of_folder(const std::string& folder) {
  if (!fs::is_directory(folder))
    throw InputError("'" + folder + "' is no folder. Give the folder that holds train.h5 or train.npz");
  std::optional<DataSetFormat> found;
  std::string found_in;
  for (const char* split : split_names)
    for (const char* ending : {".h5", ".npz"}) {
      const std::string file = (fs::path(folder) / (std::string(split) + ending)).string();
      if (!fs::is_regular_file(file)) continue;
      const DataSetFormat format = ending[1] == 'n' ? DataSetFormat::gns : format_of_hdf5(file);
      if (found && *found != format)
        throw InputError("'" + folder + "' holds data of two formats ('" + found_in + "' is " + word_of(*found) +
                         ", '" + file + "' " + word_of(format) + "). Give them folders of their own");
      found = format;
      found_in = file;
    }
  if (!found)
    throw InputError("'" + folder +
                     "' holds no data set (train, valid or test, .h5 or .npz). Give the folder with these files");
  return *found;
}

}  // namespace graupel::io
