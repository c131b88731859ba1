// Passes over all slots that add something up: each item takes some slots and leaves one record; records are merged in
// a fixed order.
#pragma once

#include <vector>

#include "mpm/particles/particles.h"

namespace graupel::mpm {

/// Slots of one item: neighbours on the CPU, strided on a GPU so that neighbouring items read neighbouring slots.
struct SlotRange {
  int64_t items, slots_per_item, slots;
  bool strided;

  GRAUPEL_HD int64_t slot(int64_t item, int64_t i) const {
    return strided ? i * items + item : item * slots_per_item + i;
  }
};

inline SlotRange make_slot_range(Device device, int64_t slots) {
  int64_t per_item = 512;
  if (device != Device::cpu) per_item = slots < 8192 * 64 ? slots / 8192 + 1 : 64;
  return {(slots + per_item - 1) / per_item, per_item, slots, device != Device::cpu};
}

/// Merges every `fold` records into one, in order.
template <typename Record>
struct MergeRecords {
  const Record* from;
  Record* to;
  int64_t count, fold;
  GRAUPEL_HD void operator()(int64_t item) const {
    Record sum;
    for (int64_t i = item * fold; i < (item + 1) * fold && i < count; ++i) sum.merge(from[i]);
    to[item] = sum;
  }
};

/// Sum of `count` records. The buffer holds twice as many places.
template <typename Record>
Record total(Device device, Buffer<Record>& records, int64_t count) {
  const Record* first = records.data();
  std::vector<Record> host;
  if (device != Device::cpu) {
    constexpr int64_t fold = 32;
    const int64_t merged = (count + fold - 1) / fold;
    parallel_for(device, merged, MergeRecords<Record>{records.data(), records.data() + count, count, fold});
    host.resize(static_cast<std::size_t>(merged));
    device_copy(Device::cpu, host.data(), device, records.data() + count, host.size() * sizeof(Record));
    first = host.data();
    count = merged;
  }
  Record sum;
  for (int64_t i = 0; i < count; ++i) sum.merge(first[i]);
  return sum;
}

}  // namespace graupel::mpm
