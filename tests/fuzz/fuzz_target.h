// What a fuzz target is: a function that feeds the bytes of a file to one of Graupel's readers and goes on as the
// program would. libfuzzer_main.cpp runs one on new inputs, replay_test.cpp all of them on the inputs in corpus/ and
// regressions/.
#pragma once

#include <cstdint>
#include <random>
#include <string>

namespace graupel::fuzz {

using Random = std::minstd_rand;

/// libFuzzer's own mutations of some bytes; at most `most` come back.
std::string mutate_bytes(std::string bytes, std::size_t most);

struct Target {
  const char* name;
  /// A graupel::Error refuses the input, which is fine; anything else that is thrown is a finding.
  void (*run)(const std::string& bytes);
  /// Changes an input and keeps what a reader would refuse at once (a checksum, a length); null: mutate_bytes() alone.
  std::string (*mutate)(const std::string& bytes, std::size_t most, Random& random);
};

namespace targets {
extern const Target scene, recipe, safetensors, mesh_obj, mesh_ply, mesh_stl, state_file, solver_state;
}  // namespace targets

inline constexpr const Target* all_targets[] = {&targets::scene,      &targets::recipe,      &targets::safetensors,
                                                &targets::mesh_obj,   &targets::mesh_ply,    &targets::mesh_stl,
                                                &targets::state_file, &targets::solver_state};

/// Path of a file of this process that holds `bytes`, for readers that take one; all are in one folder.
std::string file_with(const std::string& bytes, const std::string& name);

/// Throws std::logic_error: a finding.
void expect(bool condition, const char* what);

}  // namespace graupel::fuzz
