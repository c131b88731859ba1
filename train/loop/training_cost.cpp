#include "train/loop/training_cost.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/fnv1a.h"

namespace graupel::train {

namespace {

using Json = nlohmann::json;

/// "hgn-0123456789abcdef".
std::string name_of_data(const Json& card) {
  Json scenes = card;
  scenes.erase("made_in");
  const auto recipe = card.find("recipe");
  const std::string name = recipe != card.end() && recipe->is_object() ? recipe->value("name", "") : "";
  return (name.empty() ? "data" : name) + "-" + fnv1a_digits(scenes.dump());
}

}  // namespace

std::vector<nn::CostPart> data_cost(const std::string& folder) {
  const std::string file = folder + "/dataset.json";
  if (!std::filesystem::exists(file)) return {nn::CostPart()};
  const Json card = Json::parse(read_file(file), nullptr, /*allow_exceptions=*/false);
  if (!card.is_object()) return {nn::CostPart()};
  const std::string name = name_of_data(card);
  const auto made = card.find("made_in");
  if (made == card.end() || !made->is_array() || made->empty()) return {{name, std::nullopt, ""}};
  const std::string cost = Json{{"data", *made}, {"training", Json::array()}}.dump();
  std::vector<nn::CostPart> parts = nn::parse_offline_cost(cost, "'" + file + "' (made_in)").data;
  for (nn::CostPart& part : parts) part.name = name;
  return parts;
}

nn::OfflineCost with_training(nn::OfflineCost start, const std::string& data_folder, double seconds,
                              const std::string& device) {
  start.add_data(data_cost(data_folder));
  start.training.push_back({"", seconds, device});
  return start;
}

}  // namespace graupel::train
