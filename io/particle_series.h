// What all data sets for graph networks hold of a run: where its particles are in every frame, and their types.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace graupel::io {

struct ParticleSeries {
  std::string where;   ///< file and place in it, for messages
  int dimensions = 3;  ///< 2 or 3
  int64_t frames = 0, particles = 0;
  std::vector<float> position;           ///< [frames, particles, dimensions] [m]
  std::vector<int64_t> particle_type;    ///< [particles], ids of the file's format
  std::vector<float> material_property;  ///< [particles], what GNS stores beside the types; empty for none
};

/// One split of a data set. Throws InputError for what is damaged or does not fit.
class SeriesReader {
 public:
  virtual ~SeriesReader() = default;
  virtual int64_t count() const = 0;
  virtual ParticleSeries read(int64_t i) const = 0;
};

/// Gives trajectory i to a writer, which asks for each once, in order.
using SeriesSource = std::function<ParticleSeries(int64_t i)>;

}  // namespace graupel::io
