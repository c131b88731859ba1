#include "graph/config/hgn_config.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "graph/config/gns_config.h"

namespace graupel::graph {
namespace {

TEST(HgnConfig, MetadataRoundTripKeepsEveryValue) {
  HgnConfig config;
  config.latent = 64;
  config.levels = 2;
  config.spacing = 0.1 / 3;
  config.signed_distance = true;
  config.cell_normal = false;
  config.frame_time = 1e-3 / 7;
  config.aggregation = Aggregation::activations;
  const auto metadata = config.to_metadata();
  EXPECT_EQ(metadata.at("architecture"), "hgn");
  EXPECT_EQ(metadata.at("format_version"), "1");
  EXPECT_EQ(metadata.at("hgn.latent"), "64");
  EXPECT_EQ(metadata.at("hgn.signed_distance"), "true");
  EXPECT_EQ(metadata.at("hgn.p2g_scale"), "0.125");
  EXPECT_EQ(metadata.at("hgn.aggregation"), "activations");
  const HgnConfig read = HgnConfig::from_metadata(metadata, "f");
  EXPECT_EQ(read.to_metadata(), metadata);
  EXPECT_EQ(read.aggregation, Aggregation::activations);
  EXPECT_EQ(read.spacing, config.spacing);
  EXPECT_EQ(read.frame_time, config.frame_time);
  EXPECT_EQ(read.input_width(), 3 * 5 + 6 + 4 + 16);
}

TEST(HgnConfig, OtherMetadataIsIgnored) {
  auto metadata = HgnConfig().to_metadata();
  metadata["training.step"] = "1000";
  EXPECT_EQ(HgnConfig::from_metadata(metadata, "f").latent, 128);
}

TEST(HgnConfig, FilesFromBeforeTheChoicesHaveTheOldNetwork) {
  HgnConfig config;
  config.aggregation = Aggregation::activations;
  config.bundle = 4;
  auto metadata = config.to_metadata();
  EXPECT_EQ(metadata.at("hgn.bundle"), "4");
  EXPECT_EQ(HgnConfig::from_metadata(metadata, "f").output_width(), 12);
  EXPECT_EQ(metadata.at("hgn.predictor"), "none");
  metadata.erase("hgn.predictor");
  EXPECT_EQ(metadata.at("hgn.short_range"), "0");
  metadata.erase("hgn.aggregation");
  metadata.erase("hgn.bundle");
  metadata.erase("hgn.short_range");
  EXPECT_EQ(HgnConfig::from_metadata(metadata, "f").aggregation, Aggregation::messages);
  EXPECT_EQ(HgnConfig::from_metadata(metadata, "f").bundle, 1);
  GnsConfig gns;
  gns.bundle = 2;
  metadata = gns.to_metadata();
  EXPECT_EQ(GnsConfig::from_metadata(metadata, "f").bundle, 2);
  metadata.erase("gns.predictor");
  metadata.erase("gns.bundle");
  EXPECT_EQ(GnsConfig::from_metadata(metadata, "f").bundle, 1);
}

/// Older files have the keys of options that were removed; switched on, they are refused.
TEST(GnsConfig, ARemovedPredictorIsRefused) {
  auto metadata = GnsConfig().to_metadata();
  EXPECT_EQ(metadata.at("gns.predictor"), "none");
  EXPECT_EQ(GnsConfig::from_metadata(metadata, "f").to_metadata(), metadata);
  metadata["gns.predictor"] = "ballistic";
  try {
    GnsConfig::from_metadata(metadata, "net.safetensors");
    ADD_FAILURE();
  } catch (const InputError& error) {
    for (const char* text :
         {"'net.safetensors'", "'gns.predictor' is ballistic, but this setting was removed", "Train"})
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
  }
}

TEST(HgnConfig, ErrorsNameFileKeyAndValue) {
  const auto error = [](const std::string& key, const char* value) -> std::string {
    auto metadata = HgnConfig().to_metadata();
    if (value == nullptr)
      metadata.erase(key);
    else
      metadata[key] = value;
    try {
      HgnConfig::from_metadata(metadata, "net.safetensors");
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  const struct {
    const char *key, *value, *text;
  } cases[] = {{"hgn.latent", nullptr, "missing"},
               {"hgn.latent", "12x", "not a number ('12x')"},
               {"hgn.latent", "", "not a number"},
               {"hgn.latent", "7.5", "not a number"},
               {"hgn.latent", "4", "'4', allowed from 8"},
               {"hgn.levels", "9", "allowed from 1 to 8"},
               {"hgn.message_passing", "0", "out of range"},
               {"hgn.embedding", "65", "out of range"},
               {"hgn.history", "-1", "out of range"},
               {"hgn.spacing", "0", "allowed above 0"},
               {"hgn.spacing", "nan", "out of range"},
               {"hgn.wall_clamp", "inf", "out of range"},
               {"hgn.distance_clamp", "-1", "out of range"},
               {"hgn.p2g_scale", "0", "out of range"},
               {"hgn.frame_time", "-0.1", "out of range"},
               {"hgn.dx", "0", "out of range"},
               {"hgn.dx", "1e4", "'10000', allowed from 1e-06 to 1000"},
               {"hgn.spacing", "1e5", "'1e+05', allowed from"},
               {"hgn.p2g_scale", "64", "allowed from 0.001 to 16"},
               {"hgn.wall_clamp", "9e18", "out of range"},
               {"hgn.distance_clamp", "9e18", "out of range"},
               {"hgn.frame_time", "1e5", "out of range"},
               {"hgn.aggregation", "sums", "not one of messages, activations ('sums')"},
               {"hgn.cell_normal", "yes", "not true or false ('yes')"},
               {"hgn.bundle", "9", "allowed from 1 to 8"},
               {"hgn.predictor", "falling", "is falling, but this setting was removed"},
               {"hgn.predictor", "ballistic", "is ballistic, but this setting was removed"},
               {"hgn.short_range", "0.5", "is 0.5, but this setting was removed"},
               {"hgn.window", "2", "not known ('2')"}};
  for (const auto& c : cases) {
    const std::string message = error(c.key, c.value);
    EXPECT_NE(message.find(c.text), std::string::npos) << c.key << ": " << message;
    EXPECT_NE(message.find(c.key), std::string::npos) << message;
    EXPECT_NE(message.find("'net.safetensors'"), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace graupel::graph
