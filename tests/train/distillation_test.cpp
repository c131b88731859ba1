// Learning from a trained network: targets, the teacher's own view of the samples, what weights tell, and errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "graph/features/normalization.h"
#include "nn/offline_cost.h"
#include "tests/gpu_only.h"
#include "tests/train/gns_cloud.h"
#include "tests/train/learning.h"
#include "tests/train/tiny_data.h"
#include "train/data/teacher_target.h"
#include "train/loop/run_folder.h"
#include "train/networks/teacher.h"

namespace graupel::train {
namespace {

using ::testing::HasSubstr;

class Distillation : public testing::Test {
 protected:
  Distillation() : folder_(test_folder("distillation")) {}
  ~Distillation() override { remove_path(folder_); }

  TrainingOptions options(const std::string& run, const TrainConfig& config = tiny_config()) const {
    TrainingOptions options;
    options.data = tiny_data_set();
    options.run = folder_ + "/" + run;
    options.config = config;
    options.config.rollout_scenes = 0;
    options.threads = 1;
    options.version = "test";
    return options;
  }
  /// A trained network's weights file.
  std::string trained(const std::string& run, TrainConfig config = tiny_config()) const {
    config.steps = 5;
    config.noise_std = 1e-3;  // another normalisation than that of the runs below
    return train_network(options(run, config)).weights_file;
  }
  /// Loss of the first step of a run that starts from the weights of its teacher.
  double first_loss_of_the_teachers_equal(const std::string& run, const std::string& teacher, TrainConfig config,
                                          Device device = Device::cpu) const {
    config.steps = config.log_interval = 1;
    TrainingOptions student = options(run, config);
    student.from = student.teacher = teacher;
    student.device = device;
    double loss = -1;
    student.progress = [&](const TrainingProgress& p) { loss = p.loss; };
    train_network(student);
    return loss;
  }
  std::string refusal(const TrainingOptions& options) const {
    try {
      train_network(options);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string folder_;
};

std::string weights_of(const TrainingResult& result) {
  std::string bytes;
  for (const auto& [name, tensor] : nn::read_safetensors(result.weights_file).tensors)
    bytes.append(reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size());
  return bytes;
}

TEST_F(Distillation, TargetsAreSharesOfAccelerationsInMetres) {
  const graph::Normalization of_teacher{.acceleration_mean = {1, 0, -1}, .acceleration_std = {2, 1, 4}};
  const graph::Normalization of_target{.acceleration_mean = {0, 3, 1}, .acceleration_std = {1, 2, 0.5f}};
  const std::vector<float> predicted = {3, 1, 2, 0, 0, 0};
  const auto targets = [&](float share) {
    std::vector<float> target = {10, 20, 30, -10, 0, 10};
    const TeacherTarget mix{of_teacher, of_target, share, predicted.data(), target.data()};
    for (const int64_t i : {0, 1}) mix(i);
    return target;
  };
  EXPECT_EQ(targets(0), (std::vector<float>{10, 20, 30, -10, 0, 10}));
  EXPECT_EQ(targets(1), (std::vector<float>{7, -1, 12, 1, -1.5f, -4}));
  EXPECT_EQ(targets(0.25f), (std::vector<float>{9.25f, 14.75f, 25.5f, -7.25f, -0.375f, 6.5f}));
}

TEST_F(Distillation, ANetworkHasNothingToLearnFromItsEqual) {
  const std::string teacher = trained("teacher");
  TrainConfig config = tiny_config();
  config.noise_std = 0;
  EXPECT_LT(first_loss_of_the_teachers_equal("still", teacher, config), 1e-10);
  config.noise_std = 5e-4;  // both see the same disturbed positions, in the same grid,
  config.symmetries = true;
  config.wave_share = 0.5;
  EXPECT_LT(first_loss_of_the_teachers_equal("disturbed", teacher, config), 1e-10);
  config.push_steps = 2;  // and after frames of the student's own
  config.push_share = 1;
  EXPECT_LT(first_loss_of_the_teachers_equal("pushed", teacher, config), 1e-8);
  config.teacher_share = 0.5;
  EXPECT_GT(first_loss_of_the_teachers_equal("half", teacher, config), 1e-3);
}

TEST_F(Distillation, ANetworkHasNothingToLearnFromItsEqualOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  TrainConfig config = tiny_config();
  config.hgn.aggregation = graph::Aggregation::activations;
  config.hgn.latent = 128;  // in mixed precision
  config.push_steps = 2;
  config.push_share = 1;
  const std::string teacher = trained("teacher", config);
  // The order of sums may differ, and with it roundings to bf16.
  EXPECT_LT(first_loss_of_the_teachers_equal("equal", teacher, config, Device::cuda), 1e-5);
  config.teacher_share = 0;
  EXPECT_GT(first_loss_of_the_teachers_equal("data", teacher, config, Device::cuda), 1e-3);
}

TEST_F(Distillation, WithoutAShareTheTeacherChangesNothing) {
  for (const int64_t push_steps : {0, 1}) {  // batches of workers, batches made on the device
    const std::string of = std::to_string(push_steps);
    TrainConfig config = tiny_config();
    config.push_steps = push_steps;
    TrainingOptions with = options("with" + of, config), without = options("without" + of, config);
    with.teacher = trained("teacher" + of);
    with.config.teacher_share = 0;
    const std::string expected = weights_of(train_network(without));
    EXPECT_TRUE(weights_of(train_network(with)) == expected);
    with.run = folder_ + "/half" + of;
    with.config.teacher_share = 0.5;
    EXPECT_FALSE(weights_of(train_network(with)) == expected);
  }
}

/// Other inputs, sizes and grids than the student's, and another architecture.
TEST_F(Distillation, TeachersMayBeOtherNetworks) {
  TrainConfig large = tiny_config();
  large.hgn.latent = 24;
  large.hgn.levels = 3;
  large.hgn.spacing = 0.05;
  large.hgn.cell_normal = false;
  large.hgn.material_constants = large.hgn.contact = true;
  TrainConfig gns = tiny_gns_config();
  gns.gns.obstacle_particles = true;
  gns.gns.obstacle_spacing = 0.03;
  int run = 0;
  for (const TrainConfig& teacher : {large, gns}) {
    const std::string name = std::to_string(run++);
    TrainConfig config = tiny_config();
    config.symmetries = true;
    TrainingOptions workers = options("workers" + name, config);
    workers.teacher = trained("teacher" + name, teacher);
    TrainingOptions device = workers;
    device.run = folder_ + "/device" + name;
    device.config.push_steps = 1;  // batches made on the device,
    device.config.push_share = 0;  // none of them pushed
    EXPECT_TRUE(weights_of(train_network(device)) == weights_of(train_network(workers)));
  }
}

TEST_F(Distillation, AStudentComesToPredictWhatItsTeacherDoes) {
  TrainingOptions student = options("student");
  TrainConfig teacher = tiny_config();
  teacher.hgn.latent = 24;
  student.teacher = trained("teacher", teacher);
  LossCourse loss;
  learn_fast(student, 200, loss);
  train_network(student);
  EXPECT_LT(loss.last, loss.first / 10);
}

TEST_F(Distillation, RunsResumeWithTheirTeacherAndTellItsCost) {
  const std::string teacher = trained("teacher");
  TrainingOptions whole = options("whole"), parts = options("parts");
  whole.teacher = parts.teacher = teacher;
  whole.config.teacher_share = parts.config.teacher_share = 0.75;
  const TrainingResult result = train_network(whole);
  parts.stop_step = 10;
  train_network(parts);
  parts.stop_step = 0;
  parts.resume = true;
  EXPECT_TRUE(weights_of(train_network(parts)) == weights_of(result));
  EXPECT_EQ(read_run_facts(parts.run).teacher, teacher);
  parts.teacher = trained("other", [] {
    TrainConfig config = tiny_config();
    config.seed = 5;
    return config;
  }());
  EXPECT_THAT(refusal(parts), HasSubstr("began with another teacher ('" + teacher + "', here '" + parts.teacher));
  parts.teacher = "";
  EXPECT_THAT(refusal(parts), HasSubstr("teacher"));

  const auto metadata = nn::read_safetensors(result.weights_file).metadata;
  EXPECT_EQ(metadata.at("training.teacher"), "weights.safetensors");
  EXPECT_EQ(metadata.at("training.teacher_hash"), file_hash(teacher));
  EXPECT_EQ(metadata.at("training.teacher_share"), "0.750000");
  const auto cost_of = [](const std::string& file) {
    return nn::offline_cost_of(nn::read_safetensors(file).metadata, file);
  };
  ASSERT_EQ(cost_of(result.weights_file).training.size(), 2u);
  EXPECT_EQ(cost_of(result.weights_file).training[0].seconds, cost_of(teacher).training[0].seconds);
  // A network that starts from its teacher's weights has them once.
  whole.run = folder_ + "/from";
  whole.from = teacher;
  EXPECT_EQ(cost_of(train_network(whole).weights_file).training.size(), 2u);
}

TEST_F(Distillation, TeachersThatDoNotFitAreRefused) {
  TrainingOptions student = options("student");
  student.config.teacher_share = 0.5;
  EXPECT_THAT(refusal(student), HasSubstr("teacher_share is set (0.5"));
  student.teacher = folder_ + "/none.safetensors";
  EXPECT_THAT(refusal(student), HasSubstr("none.safetensors"));
  TrainConfig longer = tiny_config();
  longer.hgn.history = 3;
  student.teacher = trained("longer", longer);
  EXPECT_THAT(refusal(student), HasSubstr("has history 3, the network that learns 2 (a teacher's must be equal). Set "
                                          "hgn.history=3"));
  TrainConfig bundle = tiny_config();
  bundle.hgn.bundle = 2;
  student.teacher = trained("bundle", bundle);
  EXPECT_THAT(refusal(student), HasSubstr("has bundle 2, the network that learns 1"));
  nn::Weights slow = nn::read_safetensors(trained("slow"));
  slow.metadata["hgn.frame_time"] = "0.02";
  student.teacher = folder_ + "/slow.safetensors";
  nn::write_safetensors(student.teacher, slow);
  EXPECT_THAT(refusal(student), HasSubstr("has frame_time 0.016667, the network '" + student.teacher +
                                          "' is for 0.020000. Take data with its frame_time, or other weights"));
}

}  // namespace
}  // namespace graupel::train
