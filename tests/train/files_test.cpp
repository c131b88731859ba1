// What a run writes: TensorBoard records, metrics, checkpoints and their recovery.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/train/tiny_data.h"
#include "train/loop/checkpoint.h"
#include "train/loop/crc32c.h"
#include "train/loop/event_file.h"
#include "train/loop/metrics_log.h"
#include "train/loop/run_folder.h"

namespace graupel::train {
namespace {

namespace fs = std::filesystem;

TEST(Crc32c, TestVectorsOfRfc3720) {
  EXPECT_EQ(crc32c(std::string(32, '\0')), 0x8a9136aau);
  EXPECT_EQ(crc32c(std::string(32, '\xff')), 0x62a8ab43u);
  EXPECT_EQ(crc32c("123456789"), 0xe3069283u);
}

TEST(EventFile, RecordsAreFramedWithMaskedChecksums) {
  const std::string record = tf_record("abc");
  ASSERT_EQ(record.size(), 8u + 4 + 3 + 4);
  EXPECT_EQ(record.substr(0, 8), std::string("\x03\0\0\0\0\0\0\0", 8));
  EXPECT_EQ(record.substr(12, 3), "abc");
  uint32_t stored;
  std::memcpy(&stored, record.data() + 15, 4);
  const uint32_t crc = crc32c("abc");
  EXPECT_EQ(crc, 0x364b3fb7u);
  EXPECT_EQ(stored, ((crc >> 15) | (crc << 17)) + 0xa282ead8u);
}

TEST(EventFile, ScalarIsTheExpectedProtobuf) {
  // Event{wall_time: 1.0, step: 300, summary{value{tag: "a", simple_value: 0.5}}}, encoded by hand.
  const std::string expected(
      "\x09\0\0\0\0\0\0\xf0\x3f"  // 1: double 1.0
      "\x10\xac\x02"              // 2: varint 300
      "\x2a\x0a\x0a\x08"          // 5: summary of 10 bytes, 1: value of 8 bytes
      "\x0a\x01"
      "a\x15\0\0\0\x3f",  // 1: "a", 2: float 0.5
      9 + 3 + 4 + 3 + 5);
  EXPECT_EQ(scalar_event(1.0, 300, "a", 0.5f), expected);
}

TEST(MetricsLog, AResumedRunLogsEachStepOnce) {
  const std::string folder = test_folder("metrics");
  {
    MetricsLog log(folder, {"loss", "rate"}, 0);
    log.write(10, {{"loss", 1.5}, {"rate", 0.1}});
    log.write(20, {{"loss", 1.25}});
    log.write(30, {{"loss", 1.0}});
  }
  std::ofstream(folder + "/metrics.csv", std::ios::app) << "40,0";  // cut short by a kill
  {
    MetricsLog log(folder, {"loss", "rate"}, 20);
    log.write(20, {{"loss", 1.25}});  // of the same step with the same columns: once
    log.write(30, {{"loss", std::nan("")}});
  }
  EXPECT_EQ(read_file(folder + "/metrics.csv"), "step,loss,rate\n10,1.5,0.1\n20,1.25,\n30,nan,\n");
  EXPECT_EQ(read_file(folder + "/metrics.jsonl"),
            "{\"step\":10,\"loss\":1.5,\"rate\":0.1}\n{\"step\":20,\"loss\":1.25}\n{\"step\":30,\"loss\":null}\n");
  remove_path(folder);
}

Checkpoint sample_checkpoint(int64_t step) {
  Checkpoint checkpoint;
  checkpoint.state.step = step;
  checkpoint.state.seed = 0xfedcba9876543210u;
  checkpoint.state.config_hash = "abcd";
  checkpoint.state.best_validation = 0.25;
  checkpoint.state.best_step = 100;
  checkpoint.arrays["weights"].tensors["a"] = nn::Tensor::from_float({1, 2, static_cast<float>(step)}, {3});
  checkpoint.arrays["ema"].tensors["a"] = nn::Tensor::from_float({4, 5, 6}, {3});
  return checkpoint;
}

TEST(Checkpoint, ReadsBackAndKeepsTheLastTwoAndTheBest) {
  const std::string folder = test_folder("checkpoints");
  for (const int64_t step : {100, 200, 300, 400}) {
    write_checkpoint(folder, sample_checkpoint(step));
    prune_checkpoints(folder, 100);
  }
  EXPECT_TRUE(fs::exists(folder + "/step-00000100"));
  EXPECT_FALSE(fs::exists(folder + "/step-00000200"));
  make_folder(folder + "/step-00000500.part");  // left by a kill
  const auto latest = read_latest_checkpoint(folder, [](const std::string& text) { FAIL() << text; });
  ASSERT_TRUE(latest);
  EXPECT_EQ(latest->state.step, 400);
  EXPECT_EQ(latest->state.seed, 0xfedcba9876543210u);
  EXPECT_EQ(latest->state.best_validation, 0.25);
  EXPECT_EQ(latest->arrays.at("weights").get("a", {3}), (std::vector<float>{1, 2, 400}));
  remove_path(folder);
}

void flip_byte(const std::string& file, std::size_t from_end) {
  std::string bytes = read_file(file);
  bytes[bytes.size() - from_end] = static_cast<char>(bytes[bytes.size() - from_end] ^ 0x40);
  std::ofstream(file, std::ios::binary) << bytes;
}

TEST(Checkpoint, ADamagedOneFallsBackLoudlyToTheOneBefore) {
  const std::string folder = test_folder("damaged");
  for (const int64_t step : {1, 2, 3}) write_checkpoint(folder, sample_checkpoint(step));
  flip_byte(folder + "/step-00000003/weights.safetensors", 2);
  fs::remove(folder + "/step-00000002/ema.safetensors");
  std::vector<std::string> warnings;
  const auto latest = read_latest_checkpoint(folder, [&](const std::string& text) { warnings.push_back(text); });
  ASSERT_TRUE(latest);
  EXPECT_EQ(latest->state.step, 1);
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_NE(warnings[0].find("WARNING"), std::string::npos);
  EXPECT_NE(warnings[0].find("checksum"), std::string::npos);
  std::ofstream(folder + "/step-00000001/state.json") << "{";
  EXPECT_THROW(read_latest_checkpoint(folder, [](const std::string&) {}), InputError);
  remove_path(folder);
}

TEST(Checkpoint, NoneYetIsNoError) {
  EXPECT_FALSE(read_latest_checkpoint("/nonexistent", [](const std::string&) {}));
}

TEST(TrainConfig, TextReadsBackToTheSameSettings) {
  TrainConfig config = tiny_config();
  config.jitter = GridJitter::finest;
  config.schedule = RateSchedule::cosine;
  const TrainConfig back = read_train_config(train_config_text(config), "config.json");
  EXPECT_EQ(config_hash(back), config_hash(config));
  EXPECT_EQ(back.hgn.latent, 16);
  EXPECT_NE(config_hash(TrainConfig()), config_hash(config));
  EXPECT_EQ(config_hash(read_train_config(train_config_text(TrainConfig()), "defaults")), config_hash(TrainConfig()));
}

TEST(TrainConfig, RefusesUnknownKeysAndValuesOutOfRange) {
  const auto read = [](const std::string& set) { return read_train_config("{}", "command line", {set}); };
  EXPECT_EQ(read("hgn.latent=64").hgn.latent, 64);
  for (const char* bad : {"setps=5",
                          "steps=0",
                          "batch_scenes=0",
                          "learning_rate=0",
                          "final_learning_rate=-1",
                          "decay_steps=-1",
                          "warm_up_steps=-1",
                          "clip_norm=-1",
                          "ema_decay=1",
                          "noise_std=-1",
                          "log_interval=0",
                          "checkpoint_interval=0",
                          "validation_interval=0",
                          "validation_samples=0",
                          "rollout_scenes=-1",
                          "rollout_frames=0",
                          "memory_limit=-1",
                          "jitter=some",
                          "schedule=linear",
                          "tf32=2",
                          "seed=-1",
                          "hgn.latent=1"})
    EXPECT_THROW(read(bad), ConfigError) << bad;
}

}  // namespace
}  // namespace graupel::train
