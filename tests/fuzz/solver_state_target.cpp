// What a saved state holds: changed places of the state of a small run, restored with a right checksum and stepped one
// frame. An input is a byte that chooses the run, then for each changed place 8 bytes (struct Change).
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "mpm/simulation.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/mpm/changing_scenes.h"

namespace graupel::fuzz {

namespace {

constexpr std::size_t head_bytes = 32, checksum_bytes = 8, word = 4;

struct Change {
  uint16_t place;  ///< word of the contents, modulo their number
  uint8_t kind;    ///< modulo 5: bits, float, double, integer, a copy of another word
  uint8_t choice;  ///< among floats or integers
  uint32_t bits;   ///< of the word, or the place of the other one
};
static_assert(sizeof(Change) == 8);

constexpr double numbers[] = {0,     -0.0,  1,     -1,   0.5,   2,     0.1,    0.9999, 1e-3,  -1e-3,
                              1e-10, 1e-30, 1e-40, 100,  -100,  1e5,   -1e5,   1e10,   -1e10, 1e18,
                              -1e18, 1e30,  -1e30, 3e38, -3e38, 1e300, -1e300, 0.3,    0.7,   0.05};
constexpr int32_t integers[] = {0,
                                1,
                                -1,
                                2,
                                3,
                                10,
                                100,
                                255,
                                1000,
                                1 << 20,
                                std::numeric_limits<int32_t>::max(),
                                std::numeric_limits<int32_t>::min()};

double number(uint8_t choice) {
  if (choice == 254) return std::numeric_limits<double>::infinity();
  if (choice == 255) return std::numeric_limits<double>::quiet_NaN();
  return numbers[choice % std::size(numbers)];
}

void put(const Change& change, std::vector<std::byte>& state) {
  const std::size_t words = (state.size() - head_bytes - checksum_bytes) / word;
  const auto at = [&](std::size_t place) { return state.data() + head_bytes + place % words * word; };
  std::byte* to = at(change.place);
  const auto single = static_cast<float>(number(change.choice));
  const double wide = number(change.choice);
  switch (change.kind % 5) {
    case 0:
      std::memcpy(to, &change.bits, word);
      return;
    case 1:
      std::memcpy(to, &single, word);
      return;
    case 2:
      std::memcpy(change.place % words + 1 < words ? to : at(words - 2), &wide, sizeof(wide));
      return;
    case 3:
      std::memcpy(to, &integers[change.choice % std::size(integers)], word);
      return;
    default:
      std::memmove(to, at(change.bits), word);
  }
}

/// A run of few particles and substeps, and its state after two frames.
struct Run {
  Run(Scene scene, const mpm::SimulationOptions& options) {
    for (Source& source : scene.sources) source.particles_per_cell = 1;
    for (Emitter& emitter : scene.emitters) emitter.particles_per_cell = 1;
    mpm::set_steps(scene, 3, 3e-4);
    simulation = mpm::Simulation::create(scene, options);
    simulation->advance_frame();
    simulation->advance_frame();
    state = simulation->save_state();
  }
  std::unique_ptr<mpm::Simulation> simulation;
  std::vector<std::byte> state;
};

const std::vector<Run>& runs() {
  static const std::vector<Run> all = [] {
    const InstructionSet set = std::min(instruction_set(), InstructionSet::avx2);
    const mpm::SimulationOptions tuned{.instruction_set = set}, portable{.kernels = mpm::Kernels::portable},
        wide{.precision = mpm::Precision::f64, .instruction_set = set};
    std::vector<Run> made;
    bool odd = false;
    for (const auto& [name, scene] : mpm::changing_scenes()) made.emplace_back(scene, (odd = !odd) ? tuned : portable);
    made.emplace_back(mpm::every_model(), tuned);
    made.emplace_back(mpm::four_materials(0.04), wide);
    made.emplace_back(mpm::in_the_plane(mpm::scene_with("taichi_snow", {0.4, 0.1, 0.4}, 0.06)), tuned);
    return made;
  }();
  return all;
}

void run_solver_state(const std::string& bytes) {
  if (bytes.empty()) return;
  const Run& run = runs()[static_cast<uint8_t>(bytes[0]) % runs().size()];
  std::vector<std::byte> state = run.state;
  for (std::size_t i = 1; i + sizeof(Change) <= bytes.size(); i += sizeof(Change)) {
    Change change;
    std::memcpy(&change, bytes.data() + i, sizeof(change));
    put(change, state);
  }
  const uint64_t sum = fnv1a(fnv_start, state.data(), state.size() - checksum_bytes);
  std::memcpy(state.data() + state.size() - checksum_bytes, &sum, checksum_bytes);
  run.simulation->load_state(state);
  static_cast<void>(run.simulation->fields(mpm::all_fields()));
  run.simulation->advance_frame();
  static_cast<void>(run.simulation->frame());
  static_cast<void>(run.simulation->diagnostics());
  expect(run.simulation->save_state().size() == run.state.size(), "a state has grown");
}

/// Whole changes: one more, one fewer, or a field of one.
std::string mutate_solver_state(const std::string& bytes, std::size_t most, Random& random) {
  std::string changed =
      bytes.empty() ? std::string(1, '\0') : bytes.substr(0, 1 + (bytes.size() - 1) / sizeof(Change) * sizeof(Change));
  const std::size_t count = (changed.size() - 1) / sizeof(Change);
  const auto draw = [&] {
    const Change change{static_cast<uint16_t>(random()), static_cast<uint8_t>(random()), static_cast<uint8_t>(random()),
                        static_cast<uint32_t>(random())};
    return std::string(reinterpret_cast<const char*>(&change), sizeof(change));
  };
  switch (random() % 6) {
    case 0:
      changed[0] = static_cast<char>(random() % 16);
      return changed;
    case 1:
      return mutate_bytes(bytes, most);
    case 2:
      if (count > 0) return changed.erase(1 + random() % count * sizeof(Change), sizeof(Change));
      [[fallthrough]];
    case 3:
      if (count > 0) return changed.replace(1 + random() % count * sizeof(Change), sizeof(Change), draw());
      [[fallthrough]];
    default:
      return changed + draw();
  }
}

}  // namespace

const Target targets::solver_state = {"solver_state", run_solver_state, mutate_solver_state};

}  // namespace graupel::fuzz
