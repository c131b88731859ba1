// The formats of data sets for learned simulators, and which of them a folder holds.
#pragma once

#include <string>
#include <vector>

#include "core/fields.h"

namespace graupel::io {

enum class DataSetFormat {
  graupel,       ///< train.h5, valid.h5, test.h5 of our own, each trajectory with its scene
  gns,           ///< geoelements/gns: train.npz, valid.npz, test.npz, metadata.json
  lagrangebench  ///< LagrangeBench: train.h5, valid.h5, test.h5, metadata.json
};

}  // namespace graupel::io

namespace graupel {

template <>
struct EnumWords<io::DataSetFormat> {
  static constexpr std::pair<const char*, io::DataSetFormat> words[] = {
      {"graupel", io::DataSetFormat::graupel},
      {"gns", io::DataSetFormat::gns},
      {"lagrangebench", io::DataSetFormat::lagrangebench}};
};

}  // namespace graupel

namespace graupel::io {

inline constexpr const char* split_names[] = {"train", "valid", "test"};

/// "train.npz".
std::string split_file(DataSetFormat format, const std::string& split);

/// Throws InputError where the folder holds no split of a known format, or splits of two.
DataSetFormat format_of_folder(const std::string& folder);

}  // namespace graupel::io
