// Saving and restoring a solver, bit for bit: header, particle arrays in slot order, who is present, checksum.
#include <fmt/format.h>

#include <cstring>

#include "core/error.h"
#include "mpm/scene_hash.h"
#include "mpm/solver.h"

namespace graupel::mpm {

namespace {

constexpr uint64_t magic = 0x32304d504d415247ull;  // "GRAMPM02", little endian

struct Header {
  uint64_t magic, scene;
  uint64_t scalar_bytes;
  int64_t particles, frames_done;
  double frame_elapsed;
  Survey survey;
  RunStatistics statistics;
};
static_assert(std::is_trivially_copyable_v<Header>);

constexpr const char* remedy = ". Restart from the scene, or use the state that this scene and precision wrote";

}  // namespace

template <typename T>
std::vector<std::byte> Solver<T>::save_state() const {
  Header header;
  std::memset(static_cast<void*>(&header), 0, sizeof(header));  // padding too, so that equal states are equal bytes
  header.magic = magic;
  header.scene = scene_hash(scene_, options_.seed);
  header.scalar_bytes = sizeof(T);
  header.particles = static_cast<int64_t>(particle_count());
  header.frames_done = frames_done_;
  header.frame_elapsed = frame_elapsed_;
  header.survey = survey_;
  header.statistics = statistics_;
  header.statistics.solver_seconds = 0;
  std::vector<std::byte> bytes(sizeof(header));
  std::memcpy(bytes.data(), &header, sizeof(header));
  particles_.for_each_buffer([&](const auto& buffer) {
    const auto host = buffer.download();
    const std::size_t size = host.size() * sizeof(host[0]), at = bytes.size();
    bytes.resize(at + size);
    std::memcpy(bytes.data() + at, host.data(), size);
  });
  for (const Presence p : roles_.presence().download()) bytes.push_back(static_cast<std::byte>(p));
  const uint64_t checksum = fnv1a(fnv_start, bytes.data(), bytes.size());
  const auto* tail = reinterpret_cast<const std::byte*>(&checksum);
  bytes.insert(bytes.end(), tail, tail + sizeof(checksum));
  return bytes;
}

template <typename T>
void Solver<T>::load_state(const std::vector<std::byte>& state) {
  Header header;
  if (state.size() < sizeof(header) + sizeof(uint64_t))
    throw InputError(fmt::format("the saved state is too short ({} bytes){}", state.size(), remedy));
  std::memcpy(static_cast<void*>(&header), state.data(), sizeof(header));
  if (header.magic != magic) throw InputError(fmt::format("this is not a saved state of this version{}", remedy));
  if (header.scalar_bytes != sizeof(T))
    throw InputError(fmt::format("the saved state has {} bits a number, this run {}{}", 8 * header.scalar_bytes,
                                 8 * sizeof(T), remedy));
  if (header.scene != scene_hash(scene_, options_.seed) || header.particles != static_cast<int64_t>(particle_count()))
    throw InputError(fmt::format("the saved state belongs to another scene or seed{}", remedy));
  std::size_t expected = sizeof(header) + sizeof(uint64_t);
  particles_.for_each_buffer([&](auto& buffer) { expected += buffer.size() * sizeof(*buffer.data()); });
  expected += roles_.presence().size();
  uint64_t checksum = 0;
  if (state.size() == expected) std::memcpy(&checksum, state.data() + expected - sizeof(checksum), sizeof(checksum));
  if (state.size() != expected || checksum != fnv1a(fnv_start, state.data(), expected - sizeof(checksum)))
    throw InputError(
        fmt::format("the saved state is damaged ({} bytes, {} expected){}", state.size(), expected, remedy));
  const std::byte* from = state.data() + sizeof(header);
  particles_.for_each_buffer([&](auto& buffer) {
    const std::size_t size = buffer.size() * sizeof(*buffer.data());
    device_copy(options_.device, buffer.data(), Device::cpu, from, size);
    from += size;
  });
  device_copy(options_.device, roles_.presence().data(), Device::cpu, from, roles_.presence().size());
  const double seconds = statistics_.solver_seconds;
  frames_done_ = header.frames_done;
  frame_elapsed_ = header.frame_elapsed;
  survey_ = header.survey;
  statistics_ = header.statistics;
  statistics_.solver_seconds = seconds;
  find_home_blocks(view());
  blocks_.invalidate();
}

template std::vector<std::byte> Solver<float>::save_state() const;
template std::vector<std::byte> Solver<double>::save_state() const;
template void Solver<float>::load_state(const std::vector<std::byte>&);
template void Solver<double>::load_state(const std::vector<std::byte>&);

}  // namespace graupel::mpm
