// The offline cost of a model, in the words of reduced-order modelling: what its data and its training took before its
// first rollout. Kept in the metadata of weights files under "offline_cost" (docs/reference/file_formats.md).
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace graupel::nn {

/// Time that one thing took.
struct CostPart {
  std::string name;               ///< of a data set; empty for a training
  std::optional<double> seconds;  ///< wall time [s], summed over ranks and shards; nothing: not recorded
  std::string device;             ///< "NVIDIA H200", "2 threads of AMD EPYC"; empty: not recorded
};

struct OfflineCost {
  std::vector<CostPart> data, training;

  /// Adds the parts of a data set; one that is there by its name has been paid.
  void add_data(const std::vector<CostPart>& parts);
};

/// Sum [s]; nothing where a part is not recorded, or there is none.
std::optional<double> total_seconds(const std::vector<CostPart>& parts);

/// Of a model that does not say it: a part of each without seconds.
OfflineCost unknown_offline_cost();

/// JSON: {"data": [{"name", "seconds", "device"}], "training": [{"seconds", "device"}]}; seconds null where unknown.
std::string offline_cost_json(const OfflineCost& cost);
/// Throws InputError, naming `place`, for text that is no such JSON or has negative seconds.
OfflineCost parse_offline_cost(const std::string& json, const std::string& place);

inline constexpr const char* offline_cost_key = "offline_cost";
/// Of a file's metadata; unknown_offline_cost() where they do not say it. Throws InputError as above.
OfflineCost offline_cost_of(const std::map<std::string, std::string>& metadata, const std::string& file);

}  // namespace graupel::nn
