#include "nn/offline_cost.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/system/error.h"

namespace graupel::nn {

using Json = nlohmann::ordered_json;

namespace {

Json parts_json(const std::vector<CostPart>& parts) {
  Json list = Json::array();
  for (const CostPart& part : parts) {
    Json entry = Json::object();
    if (!part.name.empty()) entry["name"] = part.name;
    entry["seconds"] = part.seconds ? Json(*part.seconds) : Json();
    entry["device"] = part.device;
    list.push_back(entry);
  }
  return list;
}

std::vector<CostPart> read_parts(const Json& list, const std::string& place) {
  std::vector<CostPart> parts;
  for (const Json& entry : list) {
    CostPart part{entry.value("name", ""), std::nullopt, entry.value("device", "")};
    if (!entry.at("seconds").is_null()) part.seconds = entry.at("seconds").get<double>();
    if (part.seconds && !(*part.seconds >= 0))
      throw InputError(place + " has seconds of " + entry.at("seconds").dump() +
                       " (allowed: 0 or more, or null). Correct the file, or train the model again");
    parts.push_back(part);
  }
  return parts;
}

}  // namespace

void OfflineCost::add_data(const std::vector<CostPart>& parts) {
  const std::vector<CostPart> paid = data;
  for (const CostPart& part : parts) {
    const auto same = [&](const CostPart& other) { return !part.name.empty() && other.name == part.name; };
    if (std::none_of(paid.begin(), paid.end(), same)) data.push_back(part);
  }
}

std::optional<double> total_seconds(const std::vector<CostPart>& parts) {
  if (parts.empty()) return std::nullopt;
  double sum = 0;
  for (const CostPart& part : parts) {
    if (!part.seconds) return std::nullopt;
    sum += *part.seconds;
  }
  return sum;
}

OfflineCost unknown_offline_cost() { return {{CostPart()}, {CostPart()}}; }

std::string offline_cost_json(const OfflineCost& cost) {
  return Json{{"data", parts_json(cost.data)}, {"training", parts_json(cost.training)}}.dump();
}

OfflineCost parse_offline_cost(const std::string& json, const std::string& place) {
  try {
    const Json cost = Json::parse(json);
    return {read_parts(cost.at("data"), place), read_parts(cost.at("training"), place)};
  } catch (const Json::exception& error) {
    throw InputError(place + " is no offline cost (" + error.what() +
                     "; allowed: {\"data\": [{\"seconds\": s, \"device\": d}], \"training\": [..]}). Train the model "
                     "again");
  }
}

OfflineCost offline_cost_of(const std::map<std::string, std::string>& metadata, const std::string& file) {
  const auto found = metadata.find(offline_cost_key);
  if (found == metadata.end()) return unknown_offline_cost();
  return parse_offline_cost(found->second, "'" + file + "' (metadata " + offline_cost_key + ")");
}

}  // namespace graupel::nn
