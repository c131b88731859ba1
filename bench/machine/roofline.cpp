#include "bench/machine/roofline.h"

#include <linux/perf_event.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/parallel/memory.h"
#include "core/parallel/parallel_for.h"
#include "core/system/stopwatch.h"
#include "nn/linear.h"

namespace graupel::bench {

int64_t least_bytes_per_update(MaterialModel model, int64_t real) {
  const bool deforms = model != MaterialModel::water && model != MaterialModel::stationary;
  const int64_t F = deforms ? 9 : 0, position = 3, velocity = 3, affine = 9, stress = 6, internal = 1, volume = 1;
  constexpr int64_t integer = 4;  // material, source_index
  const int64_t scatter = real * (position + velocity + affine + stress + volume) + integer;
  const int64_t gather = real * (position + F + internal + volume) + 2 * integer;
  const int64_t written = real * (position + velocity + affine + F + stress + internal);
  return scatter + gather + written;
}

namespace {

double measured_bandwidth() {
  constexpr int64_t n = int64_t{1} << 24;
  std::vector<float> a(n), b(n, 1.0f), c(n, 2.0f);
  double best = 0;
  for (int round = 0; round < 6; ++round) {
    const Stopwatch watch;
    parallel_for_cpu(
        n / 4096,
        [&](int64_t part) {
          for (int64_t i = 4096 * part; i < 4096 * (part + 1); ++i)
            a[static_cast<std::size_t>(i)] = b[static_cast<std::size_t>(i)] + 0.5f * c[static_cast<std::size_t>(i)];
        },
        Grain{16});
    const double seconds = watch.seconds();
    best = std::max(best, 12.0 * static_cast<double>(n) / seconds);
  }
  return best;
}

double measured_product_rate() {
  constexpr int out = 128, in = 256, rows = 64;
  constexpr int64_t parts = 256, rounds = 8;
  const std::vector<float> weight(std::size_t{out} * in, 0.01f);
  const nn::Linear layer(out, in, weight.data(), in);
  double best = 0;
  for (int64_t round = 0; round < rounds; ++round) {
    const Stopwatch watch;
    parallel_for_cpu(
        parts,
        [&](int64_t) {
          thread_local Buffer<float> x(Device::cpu, std::size_t{rows} * in), y(Device::cpu, std::size_t{rows} * out);
          x.fill_zero();
          for (int again = 0; again < 4; ++again) layer.apply(x.data(), in, rows, y.data(), out);
        },
        Grain{1});
    const double seconds = watch.seconds();
    best = std::max(best, 2.0 * out * in * rows * 4 * parts / seconds);
  }
  return best;
}

int open_counter(uint64_t event) {
  perf_event_attr attributes{};
  attributes.size = sizeof(attributes);
  attributes.type = PERF_TYPE_HARDWARE;
  attributes.config = event;
  attributes.disabled = 1;
  attributes.inherit = 1;
  attributes.exclude_kernel = 1;
  attributes.exclude_hv = 1;
  return static_cast<int>(syscall(SYS_perf_event_open, &attributes, 0, -1, -1, 0));
}

}  // namespace

double memory_bandwidth(Device device) {
  return device == Device::cuda ? cuda_memory_bandwidth() : measured_bandwidth();
}

double product_rate(Device device) { return device == Device::cuda ? cuda_product_peak() : measured_product_rate(); }

InstructionCounter::InstructionCounter()
    : instructions_(open_counter(PERF_COUNT_HW_INSTRUCTIONS)), cycles_(open_counter(PERF_COUNT_HW_CPU_CYCLES)) {}

InstructionCounter::~InstructionCounter() {
  for (const int descriptor : {instructions_, cycles_})
    if (descriptor >= 0) close(descriptor);
}

void InstructionCounter::start() {
  for (const int descriptor : {instructions_, cycles_}) {
    if (descriptor < 0) continue;
    ioctl(descriptor, PERF_EVENT_IOC_RESET, 0);
    ioctl(descriptor, PERF_EVENT_IOC_ENABLE, 0);
  }
}

std::optional<InstructionCounter::Count> InstructionCounter::stop() {
  double value[2] = {0, 0};
  const int descriptor[2] = {instructions_, cycles_};
  for (int i = 0; i < 2; ++i) {
    uint64_t count = 0;
    if (descriptor[i] < 0 || ioctl(descriptor[i], PERF_EVENT_IOC_DISABLE, 0) != 0 ||
        read(descriptor[i], &count, sizeof(count)) != sizeof(count) || count == 0)
      return std::nullopt;
    value[i] = static_cast<double>(count);
  }
  return Count{value[0], value[1]};
}

}  // namespace graupel::bench
