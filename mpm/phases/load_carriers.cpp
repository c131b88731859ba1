// Carriers of a load: chosen by where they are at its start, then known by their place in the order of the sources.
// Each substep gives them one and the same change of velocity before they go to the grid, which keeps the sum of
// momentum.
#include "mpm/particles/slot_range.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

namespace {

/// Adds up what `visit(slot, sum)` adds for every slot.
template <typename Visit, typename Record>
struct SumSlots {
  SlotRange range;
  Visit visit;
  Record* records;

  GRAUPEL_HD void operator()(int64_t item) const {
    Record sum;
    for (int64_t i = 0; i < range.slots_per_item; ++i) {
      const int64_t slot = range.slot(item, i);
      if (slot < range.slots) visit(slot, sum);
    }
    records[item] = sum;
  }
};

template <typename T, typename Visit, typename Record>
Record sum_slots(const SolverView<T>& view, const Visit& visit, Buffer<Record>& records) {
  const SlotRange range = make_slot_range(view.device, view.particles.count);
  records.resize_discard(static_cast<std::size_t>(2 * range.items));
  launch<T>(view.device, range.items, SumSlots<Visit, Record>{range, visit, records.data()}, Grain{2});
  return total(view.device, records, range.items);
}

template <typename T>
GRAUPEL_HD inline T mass_of(const SolverView<T>& view, int64_t slot) {
  return view.materials[view.particles.material.get(slot)].density * view.particles.volume.get(slot);
}

template <typename T>
struct ChooseCarrier {
  SolverView<T> view;
  Vec3d place;
  double radius;
  uint8_t* carries;  ///< [n] or null

  GRAUPEL_HD void operator()(int64_t slot, CarrierSum& sum) const {
    const int32_t particle = view.particles.source_index.get(slot);
    const bool free =
        view.lifecycle.is_active(particle) && !view.is_stationary(slot) && view.lifecycle.leader(particle) == nullptr;
    const Vec3d x = view.particles.position.vec(slot).template cast<double>();
    if (!free || norm2(x - place) > radius * radius) return;
    if (carries != nullptr) carries[particle] = 1;
    sum.mass += static_cast<double>(mass_of(view, slot));
    ++sum.particles;
  }
};

template <typename T>
struct PushCarrier {
  SolverView<T> view;
  const uint8_t* carries;
  Vec<T, 3> gain;

  GRAUPEL_HD void operator()(int64_t slot, Impulse& given) const {
    const int32_t particle = view.particles.source_index.get(slot);
    if (carries[particle] == 0 || !view.lifecycle.is_active(particle)) return;
    const T mass = mass_of(view, slot);
    const Vec<T, 3> before = view.particles.velocity.vec(slot), after = before + gain;
    for (int d = 0; d < 3; ++d) given.momentum[d] += static_cast<double>(mass * (after[d] - before[d]));
    view.particles.velocity.set_vec(slot, after);
  }
};

}  // namespace

template <typename T>
CarrierSum choose_carriers(const SolverView<T>& view, const Load& load, uint8_t* carries, Buffer<CarrierSum>& records) {
  return sum_slots(view, ChooseCarrier<T>{view, load.place, load.radius, carries}, records);
}

template <typename T>
Vec3d push_carriers(const SolverView<T>& view, const uint8_t* carries, const Vec<T, 3>& gain,
                    Buffer<Impulse>& records) {
  const Impulse given = sum_slots(view, PushCarrier<T>{view, carries, gain}, records);
  return {given.momentum[0], given.momentum[1], given.momentum[2]};
}

#define GRAUPEL_INSTANTIATE(T)                                                                              \
  template CarrierSum choose_carriers<T>(const SolverView<T>&, const Load&, uint8_t*, Buffer<CarrierSum>&); \
  template Vec3d push_carriers<T>(const SolverView<T>&, const uint8_t*, const Vec<T, 3>&, Buffer<Impulse>&);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
