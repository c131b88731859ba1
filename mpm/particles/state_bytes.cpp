#include "mpm/particles/state_bytes.h"

#include <fmt/format.h>

#include "core/system/error.h"
#include "core/system/fnv1a.h"

namespace graupel::mpm {

namespace {

constexpr uint64_t magic = 0x35304d504d415247ull;  // "GRAMPM05", little endian

struct Head {
  uint64_t magic;
  StateOwner owner;
};
static_assert(std::is_trivially_copyable_v<Head> && sizeof(Head) == 32);

constexpr const char* remedy =
    ". Restart from the scene, or use the state that this scene, precision, device and instruction set wrote";

const char* text_of(SolverKind solver) {
  switch (solver) {
    case SolverKind::cpu_portable:
      return "the CPU with the portable kernels";
    case SolverKind::cpu_baseline:
      return "the CPU with GRAUPEL_SIMD=baseline";
    case SolverKind::cpu_avx2:
      return "the CPU with GRAUPEL_SIMD=avx2";
    case SolverKind::cpu_avx512:
      return "the CPU with GRAUPEL_SIMD=avx512";
    case SolverKind::gpu_portable:
      return "a GPU with the portable kernels";
    case SolverKind::gpu_tuned:
      return "a GPU with the tuned kernels";
  }
  return "an unknown device";
}

void check_owner(const StateOwner& found, const StateOwner& owner) {
  if (found.scalar_bytes != owner.scalar_bytes)
    throw InputError(fmt::format("the saved state has {} bits a number, this run {}{}", 8 * found.scalar_bytes,
                                 8 * owner.scalar_bytes, remedy));
  if (found.solver != owner.solver)
    throw InputError(fmt::format("the saved state is of a run on {}, this run is on {}{}", text_of(found.solver),
                                 text_of(owner.solver), remedy));
  if (found.scene != owner.scene || found.particles != owner.particles)
    throw InputError(fmt::format("the saved state belongs to another scene or seed{}", remedy));
}

}  // namespace

StateWriter::StateWriter(const StateOwner& owner, std::size_t content_bytes) {
  bytes_.reserve(sizeof(Head) + content_bytes + sizeof(uint64_t));
  add(Head{magic, owner});
}

void StateWriter::add_bytes(const void* from, std::size_t n) {
  const auto* begin = static_cast<const std::byte*>(from);
  bytes_.insert(bytes_.end(), begin, begin + n);
}

std::vector<std::byte> StateWriter::finish() {
  add(fnv1a(fnv_start, bytes_.data(), bytes_.size()));
  return std::move(bytes_);
}

StateReader::StateReader(const std::vector<std::byte>& bytes, const StateOwner& owner, std::size_t content_bytes)
    : next_(bytes.data() + sizeof(Head)), end_(next_ + content_bytes) {
  Head head;
  const std::size_t expected = sizeof(head) + content_bytes + sizeof(uint64_t);
  if (bytes.size() < sizeof(head) + sizeof(uint64_t))
    throw InputError(fmt::format("the saved state is too short ({} bytes){}", bytes.size(), remedy));
  std::memcpy(&head, bytes.data(), sizeof(head));
  if (head.magic != magic) throw InputError(fmt::format("this is not a saved state of this version{}", remedy));
  check_owner(head.owner, owner);
  if (bytes.size() != expected)
    throw InputError(
        fmt::format("the saved state is damaged ({} bytes, {} expected){}", bytes.size(), expected, remedy));
  uint64_t checksum = 0;
  std::memcpy(&checksum, bytes.data() + expected - sizeof(checksum), sizeof(checksum));
  if (checksum != fnv1a(fnv_start, bytes.data(), expected - sizeof(checksum)))
    throw InputError(fmt::format("the saved state is damaged (its checksum is not that of its bytes){}", remedy));
}

const std::byte* StateReader::take(std::size_t n) {
  GRAUPEL_ASSERT(n <= static_cast<std::size_t>(end_ - next_));
  const std::byte* from = next_;
  next_ += n;
  return from;
}

}  // namespace graupel::mpm
