#include "train/loop/training_steps.h"

#include <algorithm>
#include <optional>

#include "core/parallel/memory.h"
#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "train/data/device_samples.h"
#include "train/data/sampling.h"
#include "train/data/teacher_target.h"
#include "train/parallel/worker_threads.h"

namespace graupel::train {

namespace {

/// Batches are prepared on most threads where a GPU computes, on half of them where the CPU does.
int worker_count(const StepSources& sources) {
  return std::max(1, sources.device == Device::cuda ? sources.threads - 2 : sources.threads / 2);
}

BatchShard shard_of(const Comm& comm) { return {comm.rank(), comm.size()}; }

class DeviceSteps : public TrainingSteps {
 public:
  DeviceSteps(const StepSources& sources, int64_t first)
      : in_(sources), step_(first), samples_(in_.split, in_.config, in_.normalization, in_.device, shard_of(in_.comm)) {
    if (in_.teacher) teachers_samples_.emplace(samples_, in_.teacher->config, in_.teacher->normalization);
    if (step_ < in_.config.steps) start(step_);
  }

  void take(const StepSettings& settings) override {
    SampleArrays batch = samples_.take(), teachers_batch;
    if (in_.teacher) teachers_batch = teachers_samples_->take();
    if (step_ + 1 < in_.config.steps) start(step_ + 1);
    for (int64_t push = 1; push <= pushes_of(in_.config, step_); ++push) {
      const float* const own = in_.module.predict(batch);
      batch = samples_.push(own, in_.normalization, push);
      if (in_.teacher) teachers_batch = teachers_samples_->push(own, in_.normalization, push);
    }
    if (in_.teacher)
      samples_.mix_targets(in_.teacher->module.predict(teachers_batch), in_.teacher->normalization,
                           in_.config.teacher_share);
    in_.module.train_step(batch, settings, in_.comm);
    samples_.release();
    if (in_.teacher) teachers_samples_->release();
    ++step_;
  }

 private:
  void start(int64_t step) {
    samples_.start(step);
    if (in_.teacher) teachers_samples_->start(step);
  }

  StepSources in_;
  int64_t step_;
  DeviceSamples samples_;
  std::optional<DeviceSamples> teachers_samples_;  ///< the same scenes, as the teacher sees them
};

class WorkerSteps : public TrainingSteps {
 public:
  WorkerSteps(const StepSources& sources, int64_t first)
      : in_(sources),
        batches_(worker_count(in_), first, in_.config.steps, 2 * worker_count(in_) + 2,
                 [this](int64_t step) { return make(step); }) {}

  void take(const StepSettings& settings) override {
    Batches batches = batches_.next();
    if (in_.teacher) mix_targets(batches);
    in_.module.train_step(batches.own, settings, in_.comm);
  }

 private:
  struct Batches {
    Batch own, teachers;
  };

  Batches make(int64_t step) const {
    const BatchShard shard = shard_of(in_.comm);
    Batches batches{training_batch(in_.split, in_.config, in_.normalization, step, shard), {}};
    if (in_.teacher)
      batches.teachers = training_batch(in_.split, in_.teacher->config, in_.teacher->normalization, step, shard);
    return batches;
  }
  void mix_targets(Batches& batches) const {
    const std::vector<float> predicted = in_.teacher->module.predict(batches.teachers, StateArray::weights);
    const Part& target = batches.own.target;
    GRAUPEL_ASSERT(static_cast<int64_t>(predicted.size()) == target.count);
    parallel_for(
        Device::cpu, target.count / 3,
        TeacherTarget{in_.teacher->normalization, in_.normalization, static_cast<float>(in_.config.teacher_share),
                      predicted.data(), batches.own.numbers.data() + target.begin});
  }

  StepSources in_;
  OrderedQueue<Batches> batches_;
};

}  // namespace

std::unique_ptr<TrainingSteps> make_training_steps(const StepSources& sources, int64_t first,
                                                   const std::function<void(const std::string&)>& say) {
  const TrainConfig& config = sources.config;
  // Workers make batches ahead of the network, which its own frames cannot be.
  if (sources.device == Device::cpu && (config.architecture != Architecture::hgn || config.push_steps == 0))
    return std::make_unique<WorkerSteps>(sources, first);
  const uint64_t needed = DeviceSamples::bytes_for(sources.split), free = available_bytes(sources.device);
  if (needed <= free / 2) return std::make_unique<DeviceSteps>(sources, first);
  const std::string sizes = "the data set (" + std::to_string(needed >> 20) +
                            " MiB) is too large for half of the free memory of device '" + name_of(sources.device) +
                            "' (" + std::to_string(free >> 20) + " MiB)";
  if (config.push_steps > 0)
    throw ConfigError(sizes + ", where push_steps needs it. Set push_steps to 0, or train on fewer scenes");
  say(sizes + ": batches are made by the CPU, more slowly");
  return std::make_unique<WorkerSteps>(sources, first);
}

}  // namespace graupel::train
