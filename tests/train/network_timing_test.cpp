// graupel-train time: what it tells, and what it refuses.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "graph/plan/layer_plan.h"
#include "tests/graph/random_weights.h"
#include "tests/train/started_program.h"
#include "tests/train/tiny_data.h"
#include "train/data/data_set.h"

namespace graupel::train {
namespace {

using Json = nlohmann::json;

graph::GnsConfig tiny_gns() {
  graph::GnsConfig config;
  config.latent = 8;
  config.message_passing = 2;
  config.history = 2;
  config.dx = 0.03125;
  config.obstacle_particles = true;
  config.obstacle_spacing = 0.05;
  return config;
}

class NetworkTiming : public testing::Test {
 protected:
  NetworkTiming() : folder_(test_folder("timing")), data_(tiny_data_set() + "/test.h5") {
    nn::write_safetensors(hgn(), graph::random_weights(tiny_config().hgn, {}));
    nn::write_safetensors(gns(), graph::random_weights(tiny_gns(), {}));
  }
  ~NetworkTiming() override { remove_path(folder_); }
  std::string file(const std::string& name) const { return folder_ + "/" + name; }
  std::string hgn() const { return file("hgn.safetensors"); }
  std::string gns() const { return file("gns.safetensors"); }
  int run(const std::string& weights, const std::string& data, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"time",      weights, "--data",   data,  "--runs", "3",
                                      "--threads", "1",     "--device", "cpu", "--json", file("time.json")};
    words.insert(words.end(), more.begin(), more.end());
    return finish(start(words, file("log")));
  }
  std::string log() const { return read_file(file("log")); }
  Json result() const { return Json::parse(read_file(file("time.json"))); }

  std::string folder_, data_;
};

TEST_F(NetworkTiming, TellsTimeWorkAndHowItWasMeasured) {
  ASSERT_EQ(run(hgn(), data_), 0) << log();
  const Json whole = result();
  ASSERT_EQ(run(hgn(), data_, {"--first-layers", "split"}), 0) << log();
  const Json split = result();
  for (const Json& json : {whole, split}) {
    EXPECT_EQ(json["architecture"], "hgn");
    EXPECT_EQ(json["particles"], 24);
    EXPECT_EQ(json["runs"], 3);
    EXPECT_EQ(json["threads"], 1);
    EXPECT_EQ(json["device"], "cpu");
    EXPECT_EQ(json["number_type"], "f32");
    EXPECT_GT(json["fastest_seconds"].get<double>(), 0);
    EXPECT_LE(json["fastest_seconds"].get<double>(), json["seconds"].get<double>());
    EXPECT_DOUBLE_EQ(json["gflop_per_second"].get<double>(),
                     1e-9 * json["flop"].get<double>() / json["seconds"].get<double>());
  }
  EXPECT_EQ(whole["first_layers"], "whole");
  EXPECT_EQ(split["first_layers"], "split");
  EXPECT_LT(split["flop"].get<double>(), whole["flop"].get<double>());
}

TEST_F(NetworkTiming, CountsTheStateThatTheTrajectoryEndsWith) {
  const DataSplit split(data_);
  const TrajectoryInfo& trajectory = split.trajectory(0);
  const graph::HgnConfig config = tiny_config().hgn;
  const auto hierarchy =
      sparsegrid::build_hierarchy<3>(split.positions(0, trajectory.frames - 1, 1).front(), config.spacing,
                                     trajectory.context->environment.wall_low, static_cast<int>(config.levels));
  ASSERT_EQ(run(hgn(), data_, {"--first-layers", "split"}), 0) << log();
  EXPECT_EQ(result()["flop"], graph::flop_of(graph::plan_of(config), graph::rows_of(hierarchy)));
}

TEST_F(NetworkTiming, TakesAGnsWithObstacleParticles) {
  ASSERT_EQ(run(gns(), data_), 0) << log();
  EXPECT_EQ(result()["architecture"], "gns");
  EXPECT_EQ(result()["particles"], 24);
}

TEST_F(NetworkTiming, RefusesWhatItCannotTime) {
  EXPECT_EQ(run(hgn(), file("none.h5")), 3);
  EXPECT_NE(log().find("none.h5"), std::string::npos) << log();
  EXPECT_EQ(run(file("none.safetensors"), data_), 3);
  EXPECT_NE(log().find("none.safetensors"), std::string::npos) << log();

  graph::HgnConfig long_history = tiny_config().hgn;
  long_history.history = 5;
  nn::write_safetensors(file("long.safetensors"), graph::random_weights(long_history, {}));
  write_split(file("short.h5"), 1, 1, 24, 5);
  EXPECT_EQ(run(file("long.safetensors"), file("short.h5")), 3);
  EXPECT_NE(log().find("short.h5': trajectory 0 has too few frames (5, the network sees 6)"), std::string::npos)
      << log();

  nn::Weights foreign = graph::random_weights(tiny_config().hgn, {});
  foreign.metadata["architecture"] = "segnn";
  nn::write_safetensors(file("segnn.safetensors"), foreign);
  EXPECT_EQ(run(file("segnn.safetensors"), data_), 3);
  EXPECT_NE(log().find("segnn"), std::string::npos) << log();

  EXPECT_EQ(run(hgn(), data_, {"--runs", "0"}), 2);
  EXPECT_EQ(run(hgn(), data_, {"--first-layers", "half"}), 2);
  EXPECT_FALSE(std::filesystem::exists(file("time.json")));
}

}  // namespace
}  // namespace graupel::train
