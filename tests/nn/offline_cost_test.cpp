// What weights tell of the time of their data and training.
#include "nn/offline_cost.h"

#include <gtest/gtest.h>

#include "core/system/error.h"

namespace graupel::nn {
namespace {

TEST(OfflineCost, TextReadsBackToTheSame) {
  OfflineCost cost;
  cost.data = {{"hgn-1", 48.5, "a GPU"}, {"hgn-2", std::nullopt, ""}};
  cost.training = {{"", 306, "a GPU"}};
  const std::string text = offline_cost_json(cost);
  const OfflineCost read = offline_cost_of({{offline_cost_key, text}}, "w.safetensors");
  ASSERT_EQ(read.data.size(), 2u);
  EXPECT_EQ(read.data[0].name, "hgn-1");
  EXPECT_EQ(read.data[0].seconds, 48.5);
  EXPECT_EQ(read.data[0].device, "a GPU");
  EXPECT_FALSE(read.data[1].seconds);
  EXPECT_EQ(offline_cost_json(read), text);
}

TEST(OfflineCost, SumsNeedEveryPart) {
  EXPECT_EQ(total_seconds({{"", 1.5, ""}, {"", 2.0, ""}}), 3.5);
  EXPECT_FALSE(total_seconds({{"", 1.5, ""}, {"", std::nullopt, ""}}));
  EXPECT_FALSE(total_seconds({}));
  const OfflineCost silent = offline_cost_of({{"architecture", "hgn"}}, "w.safetensors");
  EXPECT_FALSE(total_seconds(silent.data));
  EXPECT_FALSE(total_seconds(silent.training));
}

TEST(OfflineCost, ADataSetIsPaidOnce) {
  OfflineCost cost;
  const std::vector<CostPart> on_two_machines = {{"hgn-1", 1.0, "a"}, {"hgn-1", 2.0, "b"}};
  cost.add_data(on_two_machines);
  cost.add_data(on_two_machines);
  cost.add_data({{"hgn-2", 4.0, "a"}});
  EXPECT_EQ(total_seconds(cost.data), 7);
  cost.add_data({CostPart()});
  cost.add_data({CostPart()});  // sets without a name may be different ones
  EXPECT_EQ(cost.data.size(), 5u);
}

TEST(OfflineCost, RefusesWhatIsNone) {
  for (const char* text : {"{", "{}", R"({"data": [], "training": [{"device": "a"}]})",
                           R"({"data": [], "training": [{"seconds": -1, "device": "a"}]})"})
    try {
      offline_cost_of({{offline_cost_key, text}}, "w.safetensors");
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("'w.safetensors' (metadata offline_cost)"), std::string::npos);
    }
}

}  // namespace
}  // namespace graupel::nn
