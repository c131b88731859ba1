#include "mpm/solver/run_loads.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"

namespace graupel::mpm {

template <typename T>
RunLoads<T>::RunLoads(Device device, const std::vector<TimedLoad>& loads, std::size_t particles)
    : loads_(loads),
      particles_(particles),
      courses_(loads.size()),
      expected_mass_(loads.size(), 0.0),
      carries_(device, 0),
      sums_(device, 0),
      impulses_(device, 0) {
  carries_.upload(std::vector<uint8_t>(loads.size() * particles, 0));
}

template <typename T>
bool RunLoads<T>::act(double time, double dt) const {
  return std::any_of(loads_.begin(), loads_.end(), [&](const TimedLoad& load) { return load.acts(time, dt) > 0; });
}

template <typename T>
Vec3d RunLoads<T>::push(const SolverView<T>& view, double time, double dt) {
  Vec3d given = {0, 0, 0};
  for (std::size_t l = 0; l < loads_.size(); ++l) {
    const double seconds = loads_[l].acts(time, dt);
    if (!(seconds > 0)) continue;
    Course& course = courses_[l];
    if (course.carriers < 0) {
      const CarrierSum found = choose_carriers(view, loads_[l], carries(l), sums_);
      course = {found.particles, found.mass};
    }
    if (course.carriers == 0) continue;
    given += push_carriers(view, carries(l), ((seconds / course.mass) * loads_[l].force).template cast<T>(), impulses_);
  }
  return given;
}

template <typename T>
void RunLoads<T>::expect(const SolverView<T>& view, double time, double dt) {
  for (std::size_t l = 0; l < loads_.size(); ++l)
    if (courses_[l].carriers < 0 && loads_[l].acts(time, dt) > 0)
      expected_mass_[l] = choose_carriers(view, loads_[l], nullptr, sums_).mass;
}

template <typename T>
double RunLoads<T>::largest_gain(double time, double dt) const {
  double gain = 0;
  for (std::size_t l = 0; l < loads_.size(); ++l) {
    const double mass = courses_[l].carriers < 0 ? expected_mass_[l] : courses_[l].mass;
    if (mass > 0) gain += norm(loads_[l].force) / mass * loads_[l].acts(time, dt);
  }
  return gain;
}

template <typename T>
int64_t RunLoads<T>::without_carriers() const {
  return std::count_if(courses_.begin(), courses_.end(), [](const Course& c) { return c.carriers == 0; });
}

template <typename T>
std::size_t RunLoads<T>::state_bytes() const {
  return courses_.size() * sizeof(Course) + carries_.size();
}

template <typename T>
void RunLoads<T>::save(StateWriter& writer) const {
  writer.add(courses_);
  writer.add(carries_);
}

template <typename T>
void RunLoads<T>::load(StateReader& reader) {
  reader.get(courses_);
  reader.get(carries_);
}

template <typename T>
void RunLoads<T>::check_state() const {
  const std::vector<uint8_t> carries = carries_.download();
  for (std::size_t l = 0; l < courses_.size(); ++l) {
    const auto first = carries.begin() + static_cast<std::ptrdiff_t>(l * particles_);
    const auto marked = static_cast<int64_t>(particles_) -
                        std::count(first, first + static_cast<std::ptrdiff_t>(particles_), uint8_t{0});
    const Course& course = courses_[l];
    const bool massive = std::isfinite(course.mass) && course.mass > 0;
    if (course.carriers < -1 || marked != std::max<int64_t>(0, course.carriers) || massive != (course.carriers > 0))
      throw InputError(
          fmt::format("the saved state is damaged (load {}: {} carriers of {} kg, {} marked). Use an older one, or run "
                      "again",
                      l, course.carriers, course.mass, marked));
  }
}

template class RunLoads<float>;
template class RunLoads<double>;

}  // namespace graupel::mpm
