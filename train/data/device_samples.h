// Training batches made on the device that trains: the positions of the data set lie in its memory, and one launch a
// particle draws noise, features and targets. The numbers are those of training_batch().
#pragma once

#include <cstdint>
#include <memory>

#include "train/data/sample_graph.h"
#include "train/data/sampling.h"

namespace graupel::train {

class DeviceSamples {
 public:
  /// Bytes of the device that the positions of a data set take.
  static uint64_t bytes_for(const DataSplit& split);

  /// Copies all positions to `device`. `split` must live as long as this. Batches are a rank's shard of the run's.
  DeviceSamples(const DataSplit& split, const TrainConfig& config, const graph::Normalization& normalization,
                Device device, BatchShard shard = {});
  /// The same batches, as another network sees them, whose history and bundle are equal. Their positions lie in memory
  /// once.
  DeviceSamples(const DeviceSamples& other, const TrainConfig& config, const graph::Normalization& normalization);
  ~DeviceSamples();

  /// Starts to make batch number `step`, beside what the device computes; two batches may be held at a time.
  void start(int64_t step);
  /// The batch that was started first; waits for it. Throws InputError when a particle lies outside its domain.
  SampleArrays take();
  /// The batch taken last, a bundle of k frames later: the network's own frames from `acceleration` [particles, 3 k]
  /// (normalised by `normalization`, in the device's memory), bundle number `push` of them, are its newest ones. Scenes
  /// that change keep the batch's true frames. Waits.
  SampleArrays push(const float* acceleration, const graph::Normalization& normalization, int64_t push);
  /// Gives the batch taken or pushed last the targets of a teacher's `acceleration` (as of push()): see TeacherTarget.
  void mix_targets(const float* acceleration, const graph::Normalization& normalization, double share);
  /// Says that all launches that read the batch taken last are in the default stream.
  void release();

 private:
  struct Slot;
  struct Impl;
  SampleArrays arrays_of(const Slot& slot, void* stream) const;

  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::train
