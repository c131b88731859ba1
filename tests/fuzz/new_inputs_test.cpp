// New inputs for every target, made from those in corpus/ by the targets' mutators: without libFuzzer, and so blind to
// what they reach. In every build, GRAUPEL_FUZZ_SECONDS (1) a target; run_all.sh takes
// 60. GRAUPEL_FUZZ_SEED repeats a run.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/fuzz/byte_mutator.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/harmless.h"

namespace graupel::fuzz {

namespace {

constexpr std::size_t largest_input = 32768;  ///< [bytes]
constexpr std::size_t most_kept = 200;

/// A file that always holds the input that is being tried, so that it is there after a crash. It goes where no test
/// failed.
class InputOnDisk {
 public:
  explicit InputOnDisk(const std::string& target)
      : path_((std::filesystem::temp_directory_path() / ("graupel_fuzz_" + target + "_" + std::to_string(::getpid())))
                  .string()),
        file_(::open(path_.c_str(), O_RDWR | O_CREAT | O_TRUNC, 0600)) {
    if (file_ < 0) throw std::runtime_error("cannot write " + path_);
  }
  ~InputOnDisk() {
    ::close(file_);
    if (!::testing::Test::HasFailure()) std::filesystem::remove(path_);
  }
  InputOnDisk(const InputOnDisk&) = delete;
  InputOnDisk& operator=(const InputOnDisk&) = delete;

  void hold(const std::string& input) {
    if (::ftruncate(file_, static_cast<off_t>(input.size())) != 0 ||
        ::pwrite(file_, input.data(), input.size(), 0) != static_cast<ssize_t>(input.size()))
      throw std::runtime_error("cannot write " + path_);
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int file_;
};

double number_from(const char* variable, double otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atof(text);
}

std::vector<std::string> seeds_of(const Target& target) {
  std::vector<std::string> seeds;
  for (const char* kind : {"corpus", "regressions"}) {
    const std::string folder = std::string(GRAUPEL_SOURCE_DIR "/tests/fuzz/") + kind + "/" + target.name;
    for (const std::string& name : names_in(folder)) seeds.push_back(read_file(folder + "/" + name));
  }
  return seeds;
}

class NewInputs : public ::testing::TestWithParam<const Target*> {};

/// Inputs that were taken are changed further, as far as most_kept of them.
TEST_P(NewInputs, AreRefusedOrTaken) {
  const Target& target = *GetParam();
  std::vector<std::string> seeds = seeds_of(target);
  const std::size_t given = seeds.size();
  ASSERT_GT(given, 0u);
  const auto start = std::chrono::steady_clock::now();
  const double seconds = number_from("GRAUPEL_FUZZ_SECONDS", 1);
  const auto now = static_cast<uint32_t>(std::chrono::system_clock::now().time_since_epoch().count());
  const auto seed = static_cast<uint32_t>(number_from("GRAUPEL_FUZZ_SEED", now));
  Random random(seed);
  seed_byte_mutations(seed);
  InputOnDisk input(target.name);
  std::printf("GRAUPEL_FUZZ_SEED=%u; a crash leaves its input in %s\n", seed, input.path().c_str());
  std::fflush(stdout);
  int inputs = 0;
  while (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < seconds) {
    std::string bytes = seeds[random() % seeds.size()];
    bytes = target.mutate == nullptr ? mutate_bytes(bytes, largest_input) : target.mutate(bytes, largest_input, random);
    if (bytes.size() > largest_input) continue;
    input.hold(bytes);
    ++inputs;
    if (expect_harmless(target, bytes, input.path())) {
      if (seeds.size() < given + most_kept)
        seeds.push_back(bytes);
      else
        seeds[given + random() % most_kept] = bytes;
    }
    if (HasFailure()) return;
  }
  std::printf("%d inputs\n", inputs);
}

std::string name_of(const ::testing::TestParamInfo<const Target*>& target) { return target.param->name; }

INSTANTIATE_TEST_SUITE_P(Targets, NewInputs, ::testing::ValuesIn(all_targets), name_of);

}  // namespace
}  // namespace graupel::fuzz
